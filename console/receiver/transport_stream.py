"""Reads the video of an MPEG transport stream, access unit by access unit (ISO/IEC 13818-1). Pure.

A robot's stream has one programme with one video stream, and one access unit in each PES packet. Whatever
comes in, an access unit that goes out is whole and decodable: from a damaged one on, all are dropped until
the next key frame.
"""

from dataclasses import dataclass
from typing import Final

PACKET_BYTES: Final = 188
_SYNC: Final = 0x47
_PAT_PID: Final = 0
_NO_PID: Final = -1
_CODECS: Final = {0x1B: "h264", 0x24: "h265"}
"""By stream type (2.4.4.10)."""
_OTHER_VIDEO: Final = {0x01: "video/mpeg", 0x02: "video/mpeg", 0x10: "video/mpeg", 0x33: "video/x-h266"}
"""Video that is not decoded here: its media type."""
_LARGEST_UNIT_BYTES: Final = 4 << 20
"""An access unit that is larger is damage: 4 MiB is more than a second of any profile."""
_PES_HEADER_BYTES: Final = 9
"""Up to PES_header_data_length."""
_MOST_PACKETS: Final = 7
"""In one payload of SRT: 1456 bytes at most."""
_COUNTER_TURN: Final = 16
"""continuity_counter has 4 bits (2.4.3.3)."""
_START_CODE: Final = b"\0\0\1"
"""Of PES packets and of NAL units."""
_VIDEO_ID: Final = 0xE0
"""Upper bits of stream_id (table 2-22)."""
_SLICES: Final = {"h264": frozenset(range(1, 6)), "h265": frozenset(range(32))}
_KEY_SLICES: Final = {"h264": frozenset({5}), "h265": frozenset(range(16, 24))}
"""NAL unit types of slices, and of those of key frames (H.264 table 7-1, H.265 table 7-1: IRAP)."""


@dataclass(frozen=True, slots=True)
class AccessUnit:
    """One coded frame.

    Args:
        codec: "h264" or "h265".
        data: its NAL units with start codes.
        pts_ticks: presentation time stamp, 33 bits of 90 kHz; None when it has none.
        first: whether it is the first one after a break: a key frame.
    """

    codec: str
    data: bytes
    pts_ticks: int | None
    first: bool


class UnknownVideoError(Exception):
    """The stream carries video of another codec; the text is its media type."""


class TransportStream:
    """Reads packets in their order.

    Attributes:
        torn: whether access units are dropped until the next key frame, as at the beginning.
        breaks: how often a torn time began after a whole access unit.
        dropped_units: access units that were dropped, as far as their beginning arrived.
        lost_key_frames: key frames among these.
        newest_pts: PTS of the newest access unit of which the beginning arrived, in ticks; None before one.
    """

    def __init__(self) -> None:
        self._pmt_pid = self._pid = _NO_PID
        self._tables: dict[int, bytes] = {}
        """The latest section by PID: one that has not changed is not read again."""
        self._codec = ""
        self._counter = -1
        self._skipped = 0
        """Payloads that are missing since the last packet of the video."""
        self._parts: list[bytes] = []
        self._size = 0
        self._expected = 0
        """Bytes of the present PES packet; 0 when it does not say."""
        self._open = False
        """Whether a PES packet is being collected."""
        self._units: list[AccessUnit] = []
        self.torn = True
        self.breaks = self.dropped_units = self.lost_key_frames = 0
        self.newest_pts: int | None = None

    def damage(self) -> None:
        """Notes that packets of the video are missing here."""
        self._counter, self._skipped = -1, 0
        self._discard()
        self._tear()

    def skip(self, payloads: int) -> None:
        """Notes that payloads are missing here; the next packet of the video shows whether it lost any.

        A payload may carry nothing but a clock reference, for which continuity_counter does not advance
        (2.4.3.3): its loss damages no frame. After so many that the counter may have gone round it is damage.
        """
        self._skipped += payloads
        if self._skipped * _MOST_PACKETS >= _COUNTER_TURN:
            self.damage()

    def feed(self, payload: bytes) -> list[AccessUnit]:
        """Takes whole transport stream packets; returns the access units that end in them.

        Raises:
            UnknownVideoError: the stream carries video of another codec.
        """
        for start in range(0, len(payload), PACKET_BYTES):
            if payload[start] != _SYNC or start + PACKET_BYTES > len(payload):
                # No transport stream from here on: nothing that follows can be trusted.
                self.damage()
                break
            pid = (payload[start + 1] & 0x1F) << 8 | payload[start + 2]
            if pid == self._pid:
                self._video(payload, start)
            elif pid in (_PAT_PID, self._pmt_pid):
                self._table(pid, payload[start : start + PACKET_BYTES])
        units, self._units = self._units, []
        return units

    def _video(self, payload: bytes, start: int) -> None:
        """Takes a packet of the video (2.4.3.2)."""
        flags, control = payload[start + 1], payload[start + 3]
        end, start = start + PACKET_BYTES, start + 4
        if flags & 0x80 or control & 0xC0:
            # transport_error_indicator, or scrambled.
            self.damage()
            return
        announced = False
        if control & 0x20:
            announced = payload[start] > 0 and bool(payload[start + 1] & 0x80)
            start += 1 + payload[start]
        if not control & 0x10:
            return
        counter, last = control & 0x0F, self._counter
        if counter == last and not announced:
            return  # The same packet again, as 2.4.3.3 permits.
        self._counter = counter
        skipped, self._skipped = self._skipped, 0
        # Where a discontinuity is announced, the counter does not show what was lost.
        lost = skipped > 0 if announced else counter != (last + 1) & 0x0F
        if start > end or (last >= 0 and lost):
            self._discard()
            self._tear()
        if flags & 0x40:
            self._finish(complete=self._expected == 0)
            self._begin(payload[start:end])
        elif self._open:
            self._parts.append(payload[start:end])
            self._size += end - start
        if self._open and (0 < self._expected <= self._size or self._size > _LARGEST_UNIT_BYTES):
            self._finish(complete=self._expected == self._size)

    def _begin(self, first: bytes) -> None:
        """Begins a PES packet (2.4.3.6)."""
        if len(first) < _PES_HEADER_BYTES or first[:3] != _START_CODE or first[3] & 0xF0 != _VIDEO_ID:
            self._tear()
            return
        length = first[4] << 8 | first[5]
        self._expected = length + 6 if length else 0
        self._parts, self._size, self._open = [first], len(first), True
        self.newest_pts = _pts(first)

    def _finish(self, *, complete: bool) -> None:
        """Ends the PES packet, if one is open, and keeps its access unit, if it can be decoded."""
        if not self._open:
            return
        pes = b"".join(self._parts)
        unit = _unit(pes)
        if not complete or not unit:
            self._tear()
        if self.torn and (not complete or not _is_key(unit, self._codec)):
            self._discard()
            return
        self._units.append(AccessUnit(self._codec, unit, _pts(pes), self.torn))
        self.torn = self._open = False

    def _discard(self) -> None:
        """Drops the PES packet under way, if there is one."""
        if self._open:
            self.dropped_units += 1
            self.lost_key_frames += _is_key(_unit(b"".join(self._parts)), self._codec)
        self._open = False

    def _tear(self) -> None:
        self.breaks += not self.torn
        self.torn = True

    def _table(self, pid: int, packet: bytes) -> None:
        """Takes a section of the PAT or PMT (2.4.4) that fits into one packet, as those of a robot do."""
        section = _section(packet)
        if not section or self._tables.get(pid) == section:
            return
        if _crc32(section):
            return
        self._tables[pid] = section
        if pid == _PAT_PID:
            self._read_pat(section)
        elif section[0] == 2:
            self._read_pmt(section)

    def _read_pat(self, section: bytes) -> None:
        for at in range(8, len(section) - 7, 4):
            number = section[at] << 8 | section[at + 1]
            if number:
                self._pmt_pid = (section[at + 2] & 0x1F) << 8 | section[at + 3]
                self._tables.pop(self._pmt_pid, None)
                return

    def _read_pmt(self, section: bytes) -> None:
        at = 12 + ((section[10] & 0x0F) << 8 | section[11])
        other = ""
        while at + 5 <= len(section) - 4:
            kind, pid = section[at], (section[at + 1] & 0x1F) << 8 | section[at + 2]
            if codec := _CODECS.get(kind):
                if (codec, pid) != (self._codec, self._pid):
                    self._finish(complete=self._expected == 0)
                    self._codec, self._pid, self._counter = codec, pid, -1
                    self._tear()
                return
            other = other or _OTHER_VIDEO.get(kind, "")
            at += 5 + ((section[at + 3] & 0x0F) << 8 | section[at + 4])
        if other:
            raise UnknownVideoError(other)


def _section(packet: bytes) -> bytes:
    """Returns the section that begins in a packet; empty when none does, or it does not end there."""
    if not packet[1] & 0x40 or not packet[3] & 0x10 or packet[1] & 0x80:
        return b""
    at = 4 + (1 + packet[4] if packet[3] & 0x20 else 0)
    if at >= len(packet):
        return b""
    at += 1 + packet[at]
    if at + 3 > len(packet):
        return b""
    end = at + 3 + ((packet[at + 1] & 0x0F) << 8 | packet[at + 2])
    # The header and CRC of a PMT, the longer one, have 16 bytes; bit 0 of byte 5: applicable now.
    current = end <= len(packet) and end - at >= 12 and packet[at + 5] & 1
    return packet[at:end] if current else b""


def _unit(pes: bytes) -> bytes:
    """Returns the access unit of a PES packet, as far as it is there."""
    return pes[_PES_HEADER_BYTES + pes[8] :]


def _is_key(unit: bytes, codec: str) -> bool:
    """Whether an access unit is a key frame: by its first slice."""
    at = unit.find(_START_CODE)
    while 0 <= at < len(unit) - 3:
        header = unit[at + 3]
        kind = header & 0x1F if codec == "h264" else header >> 1 & 0x3F
        if kind in _SLICES[codec]:
            return kind in _KEY_SLICES[codec]
        at = unit.find(_START_CODE, at + 3)
    return False


def _pts(pes: bytes) -> int | None:
    """Returns the PTS of a PES packet (2.4.3.7); None when it has none."""
    if not pes[7] & 0x80 or pes[8] < 5 or len(pes) < 14:
        return None
    return (pes[9] >> 1 & 0x07) << 30 | (pes[10] << 7 | pes[11] >> 1) << 15 | pes[12] << 7 | pes[13] >> 1


def _crc32(section: bytes) -> int:
    """Returns 0 for a section that ends with its CRC (annex A)."""
    value = 0xFFFFFFFF
    for byte in section:
        value ^= byte << 24
        for _ in range(8):
            value = (value << 1 ^ (0x04C11DB7 if value & 0x80000000 else 0)) & 0xFFFFFFFF
    return value
