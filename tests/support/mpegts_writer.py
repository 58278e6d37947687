"""Writes MPEG transport streams (ISO/IEC 13818-1) packet by packet, so that a test can damage them exactly.

Pure: written from the standard, shares nothing with what reads the streams.
"""

from dataclasses import dataclass, field
from functools import cache

PACKET_BYTES = 188
PMT_PID = 0x20
VIDEO_PID = 0x41
STREAM_TYPES = {"h264": 0x1B, "h265": 0x24, "mpeg4": 0x10, "audio": 0x0F}
_SLICES = {"h264": (b"\x67sps\0\0\1\x65", b"\x41"), "h265": (b"\x42\1sps\0\0\1\x26\1", b"\x02\1")}
"""NAL units of a key frame and of another one, the last one without its content."""


def coded_frame(codec: str, number: int, *, key: bool, size: int = 400) -> bytes:
    """Returns an access unit that no decoder takes, but that reads like one."""
    return b"\0\0\0\1" + _SLICES[codec][not key] + b"%06d" % number + b"\x55" * size


@dataclass
class Writer:
    """Makes the packets of a stream with one programme.

    Args:
        codec: of its video.
        video_pid: of its video.
        sized: whether PES packets say how long they are.
    """

    codec: str = "h264"
    video_pid: int = VIDEO_PID
    sized: bool = True
    _counters: dict[int, int] = field(default_factory=dict)

    def tables(self, current: bool = True) -> bytes:
        """Returns a PAT and a PMT."""
        pat = bytes([0, 1, 0xE0 | PMT_PID >> 8, PMT_PID & 0xFF])
        pid = bytes([0xE0 | self.video_pid >> 8, self.video_pid & 0xFF])
        pmt = pid + b"\xf0\0" + bytes([STREAM_TYPES[self.codec]]) + pid + b"\xf0\0"
        return self._section(0, 0, pat, current) + self._section(PMT_PID, 2, pmt, current)

    def unit(self, data: bytes, pts_ticks: int | None) -> list[bytes]:
        """Returns the packets of one access unit."""
        times = b""
        if pts_ticks is not None:
            upper, middle, lower = pts_ticks >> 30, pts_ticks >> 15 & 0x7FFF, pts_ticks & 0x7FFF
            times = bytes([0x21 | upper << 1]) + (middle << 1 | 1).to_bytes(2) + (lower << 1 | 1).to_bytes(2)
        head = bytes([0x80, 0x80 if times else 0, len(times)]) + times
        length = len(head) + len(data) if self.sized else 0
        pes = b"\0\0\1\xe0" + length.to_bytes(2) + head + data
        return [
            self._packet(self.video_pid, pes[at : at + 184], starts=at == 0) for at in range(0, len(pes), 184)
        ]

    def reference(self, ticks: int) -> bytes:
        """Returns a packet with a PCR and no payload, for which the counter stands still (2.4.3.3)."""
        counter = (self._counters.get(self.video_pid, 0) - 1) % 16
        head = bytes([0x47, self.video_pid >> 8, self.video_pid & 0xFF, 0x20 | counter])
        return head + (bytes([183, 0x10]) + (ticks << 15 | 0x7E00).to_bytes(6)).ljust(184, b"\xff")

    def _section(self, pid: int, table: int, content: bytes, current: bool) -> bytes:
        body = b"\0\1" + bytes([0xC0 | current]) + b"\0\0" + content
        section = bytes([table]) + (0xB000 | len(body) + 4).to_bytes(2) + body
        section += crc32(section).to_bytes(4)
        return self._packet(pid, b"\0" + section.ljust(183, b"\xff"), starts=True)

    def _packet(self, pid: int, payload: bytes, *, starts: bool) -> bytes:
        counter = self._counters.get(pid, 0)
        self._counters[pid] = (counter + 1) % 16
        stuffing = 184 - len(payload)
        adaptation = b""
        if stuffing:
            adaptation = bytes([stuffing - 1]) + (b"\0" + b"\xff" * (stuffing - 2) if stuffing > 1 else b"")
        head = bytes([0x47, starts << 6 | pid >> 8, pid & 0xFF, (0x30 if stuffing else 0x10) | counter])
        return head + adaptation + payload


@cache
def crc32(data: bytes) -> int:
    """Returns the CRC of annex A."""
    value = 0xFFFFFFFF
    for bit in (byte >> shift & 1 for byte in data for shift in range(7, -1, -1)):
        value = (value << 1 & 0xFFFFFFFF) ^ (0x04C11DB7 if value >> 31 ^ bit else 0)
    return value
