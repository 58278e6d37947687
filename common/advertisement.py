"""What a gateway says of itself on its network by DNS-SD (RFC 6763), and how much of that is believed.

Any machine of the network can say anything. What is read here is bounded, and a hint for a person: nothing
authenticates it, and a login checks the robot's certificate as ever.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

SERVICE_TYPE: Final = "_robot-gateway._tcp.local."
"""Service name of at most 15 characters (RFC 6335 5.1) over TCP, in the domain of mDNS (RFC 6762 3)."""
_LONGEST_BYTES: Final = 200
"""Of one value; one string of a TXT record has 255 bytes at the most (RFC 6763 6.1)."""
_VERSION: Final = "1"
"""Of these keys (RFC 6763 6.7)."""


@dataclass(frozen=True, slots=True)
class Advertisement:
    """What a gateway announces.

    Attributes:
        name: of the robot's gateway, for people.
        contract: package of the contract that it serves, omniseer.gateway.v1 for example.
        tls: whether connections are encrypted and callers authenticated.
    """

    name: str
    contract: str
    tls: bool

    def properties(self) -> dict[str, str]:
        """Returns the keys and values of the TXT record (RFC 6763 6)."""
        values = {
            "txtvers": _VERSION,
            "name": self.name,
            "contract": self.contract,
            "tls": str(int(self.tls)),
        }
        return {key: _cut(value.encode()) for key, value in values.items()}


def advertisement_from(properties: Mapping[bytes, bytes | None]) -> Advertisement:
    """Returns what a TXT record says; whatever is missing or damaged is empty."""

    def text(key: bytes) -> str:
        return _cut(properties.get(key) or b"")

    return Advertisement(text(b"name"), text(b"contract"), properties.get(b"tls") == b"1")


def _cut(value: bytes) -> str:
    return value[:_LONGEST_BYTES].decode("utf-8", errors="ignore")
