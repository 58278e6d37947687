"""The judge judged: streams made packet by packet, with one fault each."""

import pytest

from tests.support.mpegts import PACKET_BYTES, Stream, analyse, share_beyond

PMT_PID, VIDEO_PID = 0x20, 0x41
SLICE, IDR, SPS, PPS = 1, 5, 7, 8


def crc32(section: bytes) -> bytes:
    """The standard's own formulation, a bit at a time, so that the judge is not measured with itself."""
    register = [1] * 32
    for bit in (byte >> shift & 1 for byte in section for shift in range(7, -1, -1)):
        feedback = register[31] ^ bit
        register = [feedback, *register[:31]]
        for tap in (1, 2, 4, 5, 7, 8, 10, 11, 12, 16, 22, 23, 26):
            register[tap] ^= feedback
    return sum(bit << position for position, bit in enumerate(register)).to_bytes(4)


class Maker:
    """Writes packets with counters that are right."""

    def __init__(self, stream_type: int = 0x1B) -> None:
        self._stream_type = stream_type
        self._counters: dict[int, int] = {}
        self.packets: list[bytes] = []

    def packet(self, pid: int, payload: bytes, *, starts: bool = False, pcr_ms: int | None = None) -> None:
        counter = self._counters[pid] = (self._counters.get(pid, -1) + 1) % 16
        adaptation = b""
        if pcr_ms is not None:
            adaptation = b"\x10" + (pcr_ms * 90 << 15 | 0x7E00).to_bytes(6)
        room = PACKET_BYTES - 4 - len(payload)
        assert room >= 0
        if room or adaptation:
            adaptation = adaptation or (b"\0" if room > 1 else b"")
            adaptation = bytes([room - 1]) + adaptation.ljust(room - 1, b"\xff")
        control = 0x30 if adaptation else 0x10
        header = bytes([0x47, (0x40 if starts else 0) | pid >> 8, pid & 0xFF, control | counter])
        self.packets.append(header + adaptation + payload)

    def tables(self) -> None:
        self._table(0, b"\0\xb0\x0d\0\1\xc1\0\0\0\1" + (0xE000 | PMT_PID).to_bytes(2))
        video = bytes([self._stream_type]) + (0xE000 | VIDEO_PID).to_bytes(2) + b"\xf0\0"
        self._table(PMT_PID, b"\2\xb0\x12\0\1\xc1\0\0" + (0xE000 | VIDEO_PID).to_bytes(2) + b"\xf0\0" + video)

    def _table(self, pid: int, section: bytes) -> None:
        self.packet(pid, b"\0" + section + crc32(section), starts=True)

    def unit(self, at_ms: int, *kinds: int, sized: bool = True, filling: int = 0) -> None:
        pts = at_ms * 90
        stamp = bytes(
            [
                0x21 | pts >> 29 & 0xE,
                pts >> 22 & 0xFF,
                pts >> 14 & 0xFE | 1,
                pts >> 7 & 0xFF,
                pts << 1 & 0xFE | 1,
            ]
        )
        stream = b"".join(b"\0\0\0\1" + bytes([kind]) + b"\x55" * 8 for kind in kinds) + b"\x55" * filling
        rest = b"\x80\x80\x05" + stamp + stream
        unit = b"\0\0\1\xe0" + (len(rest) if sized else 0).to_bytes(2) + rest
        self.packet(VIDEO_PID, unit[:150], starts=True, pcr_ms=at_ms)
        for start in range(150, len(unit), 184):
            self.packet(VIDEO_PID, unit[start : start + 184])

    def analysed(self) -> Stream:
        return analyse(b"".join(self.packets))


def good(pictures: int = 5) -> Maker:
    maker = Maker()
    for number in range(pictures):
        maker.tables()
        kinds = (SPS, PPS, IDR) if number == 0 else (SLICE,)
        maker.unit(number * 40, *kinds, filling=600)
    return maker


def test_a_good_stream() -> None:
    found = good().analysed()
    assert found.codec == "h264"
    assert found.packets == len(good().packets)
    assert not found.counter_gaps
    assert found.broken_tables == 0
    assert found.longest_without_pat_ms == found.longest_without_pmt_ms == pytest.approx(40)
    assert found.longest_without_pcr_ms == pytest.approx(40)
    assert [unit.pts for unit in found.access_units] == [number * 3600 for number in range(5)]
    assert [unit.key for unit in found.access_units] == [True, False, False, False, False]
    assert found.access_units[0].headed
    assert found.access_units[0].nal_types == (SPS, PPS, IDR)
    assert all(unit.sized for unit in found.access_units)


def test_times_beyond_26_hours_fit_their_33_bits() -> None:
    maker = Maker()
    maker.tables()
    maker.unit(90_000_000, IDR)
    maker.unit(90_000_040, SLICE)
    found = maker.analysed()
    assert [unit.pts for unit in found.access_units] == [8_100_000_000, 8_100_003_600]
    assert found.longest_without_pcr_ms == pytest.approx(40)


@pytest.mark.parametrize("lost", [3, 5, 7])
def test_a_lost_packet_is_noticed(lost: int) -> None:
    maker = good()
    del maker.packets[lost]
    assert len(maker.analysed().counter_gaps) == 1


def test_a_packet_sent_twice_is_no_gap() -> None:
    maker = good()
    maker.packets.insert(3, maker.packets[3])
    assert not maker.analysed().counter_gaps


def test_an_announced_break_is_no_gap() -> None:
    maker = good()
    index = next(i for i, packet in enumerate(maker.packets) if i > 5 and packet[3] & 0x20 and packet[4])
    packet = bytearray(maker.packets[index])
    packet[3] = packet[3] & 0xF0 | (packet[3] + 5) & 0x0F
    packet[5] |= 0x80
    following = maker.packets[index + 1 :]
    maker.packets[index] = bytes(packet)
    pid = packet[1:3]
    maker.packets[index + 1 :] = [
        bytes([*one[:3], one[3] & 0xF0 | (one[3] + 5) & 0x0F, *one[4:]]) if one[2] == pid[1] else one
        for one in following
    ]
    assert not maker.analysed().counter_gaps
    packet[5] &= 0x7F
    maker.packets[index] = bytes(packet)
    assert len(maker.analysed().counter_gaps) == 1


def test_a_broken_table_is_counted_and_not_believed() -> None:
    maker = good()
    packet = bytearray(maker.packets[0])
    packet[-1] ^= 1
    maker.packets[0] = bytes(packet)
    assert maker.analysed().broken_tables == 1


def test_rare_tables_and_clocks_are_measured() -> None:
    maker = Maker()
    for number in range(10):
        if number in {0, 1, 6, 7}:
            maker.tables()
        maker.unit(number * 30 + (200 if number > 8 else 0), IDR)
    found = maker.analysed()
    assert found.longest_without_pat_ms == pytest.approx(150)
    assert found.longest_without_pmt_ms == pytest.approx(150)
    assert found.longest_without_pcr_ms == pytest.approx(230)


@pytest.mark.parametrize(
    ("kinds", "headed"),
    [
        ((SPS, PPS, IDR), True),
        ((9, SPS, PPS, 6, IDR, IDR), True),
        ((SPS, IDR), False),
        ((PPS, IDR), False),
        ((IDR, SPS, PPS), False),
        ((IDR,), False),
    ],
)
def test_parameter_sets_come_before_the_picture(kinds: tuple[int, ...], headed: bool) -> None:
    maker = Maker()
    maker.tables()
    maker.unit(0, *kinds)
    (unit,) = maker.analysed().access_units
    assert unit.key
    assert unit.headed is headed


def test_h265() -> None:
    maker = Maker(stream_type=0x24)
    maker.tables()
    maker.unit(0, 32 << 1, 33 << 1, 34 << 1, 19 << 1)
    maker.unit(40, 1 << 1)
    found = maker.analysed()
    assert found.codec == "h265"
    assert [(unit.key, unit.headed) for unit in found.access_units] == [(True, True), (False, False)]


def test_a_packet_without_length_is_noticed() -> None:
    maker = Maker()
    maker.tables()
    maker.unit(0, IDR, sized=False)
    assert not maker.analysed().access_units[0].sized


def test_a_torn_picture_at_the_end_can_be_cut_off() -> None:
    whole, more = good(), good()
    more.unit(200, SLICE, filling=600)
    data = b"".join(more.packets)
    assert analyse(data[:-PACKET_BYTES]).whole_bytes == len(b"".join(whole.packets))


def test_what_is_no_transport_stream() -> None:
    with pytest.raises(ValueError, match="0x00"):
        analyse(bytes(PACKET_BYTES))


def test_nothing_to_measure_is_never_good_enough() -> None:
    assert analyse(b"").longest_without_pcr_ms == float("inf")


def test_how_many_distances_are_too_long() -> None:
    assert share_beyond([0, 30, 70, 111, 130], 40) == 0.25
    assert share_beyond([7], 40) == share_beyond([], 40) == 1
