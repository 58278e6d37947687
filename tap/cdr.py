"""Serialised messages of ROS 2: reads fields of CDR in their order, without copying the large ones. Pure.

The encoding is plain CDR (OMG DDS-XTypes 7.4.1, RTPS 10.2): four bytes that name the byte order, then each
number at a multiple of its size, counted from there. Any length may be wrong: nothing is read, and no memory
taken, beyond the bytes that are there.
"""

import struct
from typing import Final

from tap.refusal import Reason, RefusedError

_HEADER_BYTES: Final = 4
_ORDERS: Final = {b"\x00\x00": ">", b"\x00\x01": "<"}
"""CDR_BE and CDR_LE; the two bytes of options that follow have no meaning for them."""
_LONGEST_STRING: Final = 4096
"""Of the strings that are read: a frame's name, an encoding."""


class Reader:
    """Reads a message from its beginning.

    Args:
        message: all of it.

    Raises:
        RefusedError: it is not CDR.
    """

    def __init__(self, message: bytes) -> None:
        order = _ORDERS.get(bytes(message[:2]))
        if order is None or len(message) < _HEADER_BYTES:
            raise RefusedError(Reason.MALFORMED, "is not serialised as CDR")
        self._order = order
        self._bytes = memoryview(message)[_HEADER_BYTES:]
        self._at = 0

    def u8(self) -> int:
        """Returns an octet."""
        return int(self._take(1)[0])

    def u32(self) -> int:
        """Returns an unsigned long."""
        return int(struct.unpack(f"{self._order}I", self._aligned(4))[0])

    def i32(self) -> int:
        """Returns a long."""
        return int(struct.unpack(f"{self._order}i", self._aligned(4))[0])

    def string(self) -> str:
        """Returns a string, without the NUL at its end; what is not UTF-8 becomes U+FFFD."""
        length = self.u32()
        if length > _LONGEST_STRING:
            raise RefusedError(Reason.MALFORMED, f"has a string of {length} bytes")
        return bytes(self._take(length)).rstrip(b"\0").decode("utf-8", "replace")

    def octets(self) -> memoryview:
        """Returns a sequence of octets, as a view of the message."""
        return self._take(self.u32())

    def _aligned(self, size: int) -> memoryview:
        self._at += -self._at % size
        return self._take(size)

    def _take(self, size: int) -> memoryview:
        end = self._at + size
        if end > len(self._bytes):
            raise RefusedError(
                Reason.MALFORMED, f"ends after {len(self._bytes)} bytes, within a field that ends at {end}"
            )
        taken = self._bytes[self._at : end]
        self._at = end
        return taken
