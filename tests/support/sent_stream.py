"""What an SRT listener sends, by its packets on their way: the stream before anything of it is lost."""

from typing import Final

from tests.support.whole_pictures import WholePictures

_HEADER_BYTES: Final = 16
_CONTROL: Final = 0x80
_ENCRYPTED: Final = 0x18
"""Bits of the first and the fifth byte (draft-sharabayko-srt-01 3 and 3.1)."""
_NUMBERS: Final = 1 << 31


class SentStream:
    """Takes a listener's packets: the `tap` of a `UdpLink`. What is repeated is the same packet again.

    A caller that connects anew gets the stream from another key frame on.
    """

    def __init__(self) -> None:
        self._connections: dict[bytes, dict[int, bytes]] = {}
        """Payloads by the caller's socket and by number."""
        self._encrypted = False

    def take(self, packet: bytes) -> None:
        """Takes a datagram."""
        if len(packet) <= _HEADER_BYTES or packet[0] & _CONTROL:
            return
        self._encrypted |= bool(packet[4] & _ENCRYPTED)
        number, caller = int.from_bytes(packet[:4]), packet[12:16]
        self._connections.setdefault(caller, {})[number] = packet[_HEADER_BYTES:]

    @property
    def size_bytes(self) -> int:
        """Of the payloads, each counted once for each caller."""
        return sum(len(payload) for each in self._payloads() for payload in each.values())

    def pictures(self) -> WholePictures:
        """Returns the frames that were sent up to now; another thread may go on taking packets."""
        assert not self._encrypted, "an encrypted stream can't be read on its way"
        return WholePictures(b"".join(_in_order(each) for each in self._payloads()))

    def _payloads(self) -> list[dict[int, bytes]]:
        return [dict(each) for each in list(self._connections.values())]


def _in_order(payloads: dict[int, bytes]) -> bytes:
    """Returns the payloads of a connection, whose numbers may wrap around."""
    first = next(iter(payloads))

    def distance(number: int) -> int:
        return (number - first + _NUMBERS // 2) % _NUMBERS

    return b"".join(payloads[number] for number in sorted(payloads, key=distance))
