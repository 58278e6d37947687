"""How many attackers there are, and for how long."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Plan:
    """The attackers of one process.

    Args:
        idle: connections of one address that make no call.
        addresses: further addresses with such connections.
        idle_per_address: of each of them.
        slow: callers that send a byte of their TLS handshake each second.
        flooders: callers with wrong tokens, each from an address of its own.
        tokens: theirs, in turns.
        burns: whether the process does nothing but take its core, as a control.
        turn: of the siege, from 0; no address attacks in two of them, so none is blocked when it begins.
    """

    idle: int = 0
    addresses: int = 0
    idle_per_address: int = 0
    slow: int = 0
    flooders: int = 0
    tokens: tuple[str, ...] = ()
    burns: bool = False
    turn: int = 0


@dataclass(frozen=True, slots=True)
class Size:
    """A siege.

    Args:
        holders: attackers that take connections.
        flooders: how many attackers make calls.
        streams: of the caller that is revoked.
        turns: how often the operator is measured alone, then besieged.
        alone_s: duration of the one, and of the control between the two.
        besieged_s: duration of the other, the attackers' arrival included.
    """

    holders: Plan
    flooders: int
    streams: int
    turns: int
    alone_s: float
    besieged_s: float

    def __str__(self) -> str:
        held = self.holders
        return (
            f"{held.idle} idle connections of one address, {held.idle_per_address} each of {held.addresses}, "
            f"{held.slow} slow handshakes, {self.flooders} callers with wrong tokens"
        )


FULL: Final = Size(
    Plan(idle=2000, addresses=100, idle_per_address=50, slow=100),
    flooders=10,
    streams=100,
    turns=5,
    alone_s=10,
    besieged_s=20,
)
SMALL: Final = Size(
    Plan(idle=200, addresses=20, idle_per_address=10, slow=20),
    flooders=4,
    streams=20,
    turns=1,
    alone_s=3,
    besieged_s=6,
)
"""For a test."""
