"""Reads an MPEG transport stream (ISO/IEC 13818-1) byte by byte, and says what a judge wants to know of it.

Pure: written from the standard, shares nothing with what made the stream.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

PACKET_BYTES = 188
_SYNC = 0x47
_NULL_PID = 0x1FFF
_PAT_PID = 0
_CLOCK_HZ = 27_000_000
_CODECS = {0x1B: "h264", 0x24: "h265"}


@dataclass(frozen=True)
class AccessUnit:
    """One access unit of video.

    Args:
        pts: presentation time on the 90 kHz clock.
        nal_types: of its NAL units, in order.
        key: whether it is an key frame (IDR).
        headed: whether its parameter sets come with it, before the first slice.
        sized: whether its PES packet says how long it is.
    """

    pts: int
    nal_types: tuple[int, ...]
    key: bool
    headed: bool
    sized: bool


@dataclass
class Stream:
    """What was found."""

    codec: str = ""
    packets: int = 0
    counter_gaps: list[str] = field(default_factory=list)
    """Where packets are missing: one line for each."""
    broken_tables: int = 0
    """PATs and PMTs whose CRC is wrong."""
    table_times_ms: dict[str, list[float]] = field(default_factory=lambda: {"PAT": [], "PMT": []})
    clock_times_ms: list[float] = field(default_factory=list)
    """The clock references (PCR), by their own word."""
    access_units: list[AccessUnit] = field(default_factory=list)
    whole_bytes: int = 0
    """Up to where the stream holds whole access units: a recording rarely ends with one."""

    @property
    def longest_without_pat_ms(self) -> float:
        """Between two program association tables, by the stream's clock."""
        return _longest(self.table_times_ms["PAT"])

    @property
    def longest_without_pmt_ms(self) -> float:
        """Between two program map tables."""
        return _longest(self.table_times_ms["PMT"])

    @property
    def longest_without_pcr_ms(self) -> float:
        """Between two clock references."""
        return _longest(self.clock_times_ms)


def analyse(data: bytes) -> Stream:
    """Reads a stream that begins with a whole packet; a torn packet at the end is ignored.

    Raises:
        ValueError: not a transport stream, or packets lost their rhythm.
    """
    return _Analysis().run(data)


CLOCK_LIMIT_MS = 40.0
"""Between clock references, as docs/preview.md promises; ISO/IEC 13818-1 2.7.2 permits 100 ms."""
TABLE_LIMIT_MS = 100.0
"""Between PATs and between PMTs, as docs/preview.md promises."""


def share_of_the_limits(stream: Stream) -> float:
    """The longest distance of clock references and tables, as a share of its limit; at most 1 is right."""
    return max(
        stream.longest_without_pcr_ms / CLOCK_LIMIT_MS,
        stream.longest_without_pat_ms / TABLE_LIMIT_MS,
        stream.longest_without_pmt_ms / TABLE_LIMIT_MS,
    )


def share_beyond(times_ms: list[float], limit_ms: float) -> float:
    """The share of distances that are longer, 0 to 1; 1 where there is nothing to measure."""
    distances = [later - earlier for earlier, later in pairwise(times_ms)]
    return sum(distance > limit_ms for distance in distances) / len(distances) if distances else 1.0


def _longest(times_ms: list[float]) -> float:
    """The longest distance; infinite where there is nothing to measure."""
    return max((later - earlier for earlier, later in pairwise(times_ms)), default=float("inf"))


class _Analysis:
    def __init__(self) -> None:
        self._found = Stream()
        self._counters: dict[int, int] = {}
        self._pmt_pid = -1
        self._video_pid = -1
        self._clock_pid = -1
        self._unit = b""
        self._now_ms: float | None = None
        self._tables_before_clock: list[str] = []

    def run(self, data: bytes) -> Stream:
        for start in range(0, len(data) - PACKET_BYTES + 1, PACKET_BYTES):
            self._packet(data[start : start + PACKET_BYTES])
        self._end_unit()
        return self._found

    def _packet(self, packet: bytes) -> None:
        if packet[0] != _SYNC:
            raise ValueError(f"packet {self._found.packets} begins with 0x{packet[0]:02x}, not 0x47")
        self._found.packets += 1
        pid = (packet[1] & 0x1F) << 8 | packet[2]
        if pid == _NULL_PID:
            return
        starts, control, payload = bool(packet[1] & 0x40), packet[3] >> 4 & 3, packet[4:]
        announced = False
        if control & 2:
            announced = self._adaptation(pid, payload[1 : 1 + payload[0]])
            payload = payload[1 + payload[0] :]
        self._count(pid, packet[3] & 0x0F, has_payload=bool(control & 1), announced=announced)
        if control & 1:
            self._payload(pid, payload, starts=starts)

    def _adaptation(self, pid: int, adaptation: bytes) -> bool:
        """Takes the clock reference out; returns whether a break of the counter is announced."""
        if not adaptation:
            return False
        if adaptation[0] & 0x10 and pid == self._clock_pid:
            base = int.from_bytes(adaptation[1:6]) >> 7
            extension = int.from_bytes(adaptation[5:7]) & 0x1FF
            self._now_ms = (base * 300 + extension) * 1000 / _CLOCK_HZ
            self._found.clock_times_ms.append(self._now_ms)
            for name in self._tables_before_clock:
                self._found.table_times_ms[name].append(self._now_ms)
            self._tables_before_clock.clear()
        return bool(adaptation[0] & 0x80)

    def _count(self, pid: int, counter: int, *, has_payload: bool, announced: bool) -> None:
        last = self._counters.get(pid)
        self._counters[pid] = counter
        if last is None or announced:
            return
        # A packet may be sent twice; one without payload doesn't count up.
        allowed = {(last + 1) % 16, last} if has_payload else {last}
        if counter not in allowed:
            self._found.counter_gaps.append(
                f"packet {self._found.packets - 1}, PID {pid}: {counter} after {last}"
            )

    def _payload(self, pid: int, payload: bytes, *, starts: bool) -> None:
        if pid == self._video_pid:
            if starts:
                self._end_unit()
                self._unit = payload
                self._found.whole_bytes = (self._found.packets - 1) * PACKET_BYTES
            elif self._unit:
                self._unit += payload
        elif starts and pid in (_PAT_PID, self._pmt_pid):
            self._table("PAT" if pid == _PAT_PID else "PMT", payload[1 + payload[0] :])

    def _table(self, name: str, section: bytes) -> None:
        section = section[: 3 + ((section[1] & 0x0F) << 8 | section[2])]
        if _crc32(section):
            self._found.broken_tables += 1
            return
        # A table belongs to the access unit that follows it, so to the next clock reference.
        self._tables_before_clock.append(name)
        if name == "PAT":
            self._pmt_pid = (section[10] & 0x1F) << 8 | section[11]
        else:
            self._map(section)

    def _map(self, section: bytes) -> None:
        self._clock_pid = (section[8] & 0x1F) << 8 | section[9]
        position = 12 + ((section[10] & 0x0F) << 8 | section[11])
        while position < len(section) - 4:
            kind, pid = section[position], (section[position + 1] & 0x1F) << 8 | section[position + 2]
            position += 5 + ((section[position + 3] & 0x0F) << 8 | section[position + 4])
            if kind in _CODECS:
                self._found.codec, self._video_pid = _CODECS[kind], pid

    def _end_unit(self) -> None:
        unit, self._unit = self._unit, b""
        if not unit:
            return
        if unit[:3] != b"\0\0\1":
            raise ValueError("a PES packet without its start code")
        pts = (unit[9] >> 1 & 7) << 30 | (unit[10] << 7 | unit[11] >> 1) << 15 | unit[12] << 7 | unit[13] >> 1
        stream = unit[9 + unit[8] :]
        kinds = tuple(_nal_types(stream, self._found.codec))
        slices, idr, parameters = _KINDS[self._found.codec]
        first_slice = next((at for at, kind in enumerate(kinds) if kind in slices), len(kinds))
        self._found.access_units.append(
            AccessUnit(
                pts=pts,
                nal_types=kinds,
                key=any(kind in idr for kind in kinds),
                headed=parameters <= set(kinds[:first_slice]),
                sized=unit[4:6] != b"\0\0",
            )
        )


_KINDS = {
    # Slices, IDR slices, parameter sets.
    "h264": (frozenset(range(1, 6)), frozenset({5}), frozenset({7, 8})),
    "h265": (frozenset(range(32)), frozenset({19, 20}), frozenset({32, 33, 34})),
}


def _nal_types(stream: bytes, codec: str) -> Iterator[int]:
    at = stream.find(b"\0\0\1")
    while 0 <= at < len(stream) - 3:
        header = stream[at + 3]
        yield header & 0x1F if codec == "h264" else header >> 1 & 0x3F
        at = stream.find(b"\0\0\1", at + 3)


def _crc32(section: bytes) -> int:
    """0 for a section that ends with the right CRC (polynomial 0x04C11DB7, most significant bit first)."""
    crc = 0xFFFFFFFF
    for byte in section:
        crc ^= byte << 24
        for _ in range(8):
            crc = crc << 1 ^ (0x04C11DB7 if crc & 0x80000000 else 0)
        crc &= 0xFFFFFFFF
    return crc
