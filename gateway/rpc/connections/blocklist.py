"""Which addresses may not connect for a while: those whose connections were of no use, or flooded."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from heapq import nlargest
from itertools import islice
from typing import Final

from common.token_bucket import TokenBucket

UNUSED_BURST: Final = 32
"""Connections without an admitted call that an address may have had before it is blocked."""
UNUSED_PER_S: Final = 1.0
"""And so many a second: probes of an orchestrator, or a client that retries without success."""
UNUSED_IF_STRICT: Final = 4
"""Instead of UNUSED_BURST while strangers connect faster than the gateway can take (shedding.py)."""
FIRST_BLOCK_S: Final = 1.0
BLOCK_FACTOR: Final = 4
LONGEST_BLOCK_S: Final = 64.0
"""Each block of an address is longer than the one before, up to this one."""
FLOOD_BLOCK_S: Final = 300.0
"""Also of one that took part while strangers connected faster than the gateway can take."""
FORGOTTEN_AFTER_S: Final = 120.0
"""After a block has ended: the next one is a first one again."""
TRUSTED_S: Final = 3600.0
"""For so long after an admitted call an address is not blocked: others may share it with a valid caller."""
MAX_BLOCKED: Final = 256
"""Addresses; where there are more, those go whose block ends first. The kernel compares each connection with
all of them."""
MAX_TRUSTED: Final = 128
"""Trusted addresses that are spared at once; where there are more, those that were heard of last."""
MAX_REMEMBERED: Final = 1024
"""Addresses; where there are more, those go that were heard of first."""
_NEVER: Final = frozenset({"127.0.0.1", "::", "fe80::"})
"""Prefixes that all have in common: the ends of tunnels (with that of ::1), and one link's neighbours."""


@dataclass(slots=True)
class _Address:
    """What is remembered of one.

    Attributes:
        block_s: how long its newest block for unused connections was; 0 without one.
        ends_s: when its newest block ends or has ended.
        trusted_until_s: until then it is not blocked.
    """

    unused: TokenBucket
    block_s: float = 0.0
    ends_s: float = -math.inf
    trusted_until_s: float = -math.inf


class Blocklist:
    """Pure. All addresses are prefixes (`gateway.access.address_prefix`).

    Args:
        clock: seconds, monotonic.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._addresses: dict[str, _Address] = {}
        """The one that was heard of last at the end."""

    def note_admitted(self, prefix: str) -> None:
        """Ends the block of an address from which a call was admitted, and trusts it for TRUSTED_S."""
        address, now_s = self._remember(prefix), self._clock()
        address.trusted_until_s = now_s + TRUSTED_S
        address.ends_s = min(address.ends_s, now_s)

    def note_unused(self, prefix: str, *, strict: bool = False) -> None:
        """Takes down that a connection ended, or was closed, without an admitted call.

        Args:
            prefix: its address.
            strict: whether fewer such connections block it, and for longer.
        """
        now_s = self._clock()
        address = self._remember(prefix)
        if address.ends_s > now_s:
            return  # it was accepted before the block
        capacity = UNUSED_IF_STRICT if strict else UNUSED_BURST
        if address.unused.take(now_s, capacity=capacity, refill_per_s=UNUSED_PER_S):
            return
        if strict:
            self._block(prefix, FLOOD_BLOCK_S)
            return
        if now_s - address.ends_s >= FORGOTTEN_AFTER_S:
            address.block_s = 0.0
        address.block_s = min(LONGEST_BLOCK_S, address.block_s * BLOCK_FACTOR) or FIRST_BLOCK_S
        self._block(prefix, address.block_s)

    def note_flood(self, prefix: str) -> None:
        """Takes down that a connection without an admitted call made more calls than it could expect to."""
        self._block(prefix, FLOOD_BLOCK_S)

    def blocked(self) -> frozenset[str]:
        """Returns the addresses that may not connect now."""
        now_s = self._clock()
        blocked = [prefix for prefix, each in self._addresses.items() if each.ends_s > now_s]
        if len(blocked) > MAX_BLOCKED:
            blocked = nlargest(MAX_BLOCKED, blocked, key=lambda prefix: self._addresses[prefix].ends_s)
        return frozenset(blocked)

    def is_trusted(self, prefix: str) -> bool:
        """Returns whether the address is never blocked, or not now because a call from it was admitted."""
        address = self._addresses.get(prefix)
        return prefix in _NEVER or (address is not None and address.trusted_until_s > self._clock())

    def trusted(self) -> frozenset[str]:
        """Returns the addresses that are trusted now."""
        heard_last = (prefix for prefix in reversed(self._addresses) if self.is_trusted(prefix))
        return _NEVER.union(islice(heard_last, MAX_TRUSTED))

    def _remember(self, prefix: str) -> _Address:
        address = self._addresses.pop(prefix, None)
        if address is None:
            address = _Address(TokenBucket(UNUSED_BURST, self._clock()))
            if len(self._addresses) >= MAX_REMEMBERED:
                self._forget_one()
        self._addresses[prefix] = address
        return address

    def _forget_one(self) -> None:
        """An attacker with many addresses displaces its own rather than those that are blocked or trusted."""
        now_s = self._clock()
        kept = (
            prefix
            for prefix, each in self._addresses.items()
            if max(each.ends_s, each.trusted_until_s) <= now_s
        )
        oldest = next(kept, next(iter(self._addresses)))
        del self._addresses[oldest]

    def _block(self, prefix: str, block_s: float) -> None:
        address, now_s = self._remember(prefix), self._clock()
        if not self.is_trusted(prefix):
            address.ends_s = max(address.ends_s, now_s + block_s)
