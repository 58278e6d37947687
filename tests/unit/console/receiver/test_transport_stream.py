"""Access units out of a transport stream: whole ones, and after damage none before the next key frame."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.receiver.transport_stream import AccessUnit, TransportStream, UnknownVideoError
from tests.support.mpegts_writer import VIDEO_PID, Writer, coded_frame

GOP = 5


def stream(writer: Writer, frames: int) -> list[list[bytes]]:
    """Returns the packets of each frame; every GOP-th is a key frame behind its tables."""
    found = []
    for number in range(frames):
        key = number % GOP == 0
        data = coded_frame(writer.codec, number, key=key)
        tables = writer.tables()
        packets = [tables[:188], tables[188:]] if key else []
        found.append(packets + writer.unit(data, number * 3000))
    return found


def numbers(units: list[AccessUnit]) -> list[int]:
    return [(unit.pts_ticks or 0) // 3000 for unit in units]


def fed(reader: TransportStream, packets: list[bytes]) -> list[AccessUnit]:
    return [unit for packet in packets for unit in reader.feed(packet)]


@pytest.mark.parametrize("codec", ["h264", "h265"])
def test_each_unit_comes_with_its_last_packet(codec: str) -> None:
    reader, writer = TransportStream(), Writer(codec)
    for number, packets in enumerate(stream(writer, 12)):
        assert fed(reader, packets[:-1]) == []
        (unit,) = reader.feed(packets[-1])
        assert unit.data == coded_frame(codec, number, key=number % GOP == 0)
        assert (unit.codec, unit.pts_ticks, unit.first) == (codec, number * 3000, number == 0)
    assert (reader.torn, reader.breaks, reader.dropped_units) == (False, 0, 0)


@pytest.mark.parametrize("codec", ["h264", "h265"])
@pytest.mark.parametrize(
    ("number", "packet", "lost"),
    [
        pytest.param(5, -1, 1, id="the end of a key frame"),
        pytest.param(5, 3, 1, id="the middle of one"),
        pytest.param(5, 2, 0, id="its beginning, without which it is not known to be one"),
        pytest.param(6, 1, 0, id="another frame"),
    ],
)
def test_key_frames_that_are_lost_are_counted(codec: str, number: int, packet: int, lost: int) -> None:
    reader = TransportStream()
    for index, packets in enumerate(stream(Writer(codec), 10)):
        if index == number:
            del packets[packet]
        fed(reader, packets)
    assert reader.torn
    assert reader.lost_key_frames == lost


def test_a_payload_of_seven_packets_is_read_at_once() -> None:
    packets = b"".join(packet for frame in stream(Writer(), 10) for packet in frame)
    reader = TransportStream()
    units = [unit for at in range(0, len(packets), 1316) for unit in reader.feed(packets[at : at + 1316])]
    assert numbers(units) == list(range(10))


def test_a_unit_without_length_ends_with_the_next_one() -> None:
    reader = TransportStream()
    frames = stream(Writer(sized=False), 3)
    assert fed(reader, frames[0]) == []
    assert numbers(fed(reader, frames[1])) == [0]
    assert numbers(fed(reader, frames[2])) == [1]


def test_a_viewer_that_joins_begins_with_a_key_frame() -> None:
    writer, reader = Writer(), TransportStream()
    reader.feed(writer.tables())
    frames = stream(writer, 12)[3:]
    assert numbers([unit for frame in frames for unit in fed(reader, frame)]) == [5, 6, 7, 8, 9, 10, 11]
    assert (reader.breaks, reader.dropped_units) == (0, 2)


@pytest.mark.parametrize("noted", [True, False], ids=["known", "by the counter alone"])
def test_from_a_damaged_unit_on_none_is_shown_until_a_key_frame(noted: bool) -> None:
    reader, shown = TransportStream(), []
    for number, frame in enumerate(stream(Writer(), 12)):
        if number == 2:
            shown += fed(reader, frame[:1])
            if noted:
                reader.damage()
            shown += fed(reader, frame[2:])
        else:
            shown += fed(reader, frame)
    assert numbers(shown) == [0, 1, 5, 6, 7, 8, 9, 10, 11]
    assert [unit.first for unit in shown[:4]] == [True, False, True, False]
    assert (reader.breaks, reader.dropped_units) == (1, 3)


@pytest.mark.parametrize("known", [True, False], ids=["of the video", "of a payload"])
def test_a_lost_end_is_noticed_although_nothing_is_missing_after_it(known: bool) -> None:
    reader, frames = TransportStream(), stream(Writer(), 7)
    fed(reader, frames[0])
    fed(reader, frames[1][:-1])
    if known:
        reader.damage()
    else:
        reader.skip(1)
    assert numbers([unit for frame in frames[2:] for unit in fed(reader, frame)]) == [5, 6]


def test_the_loss_of_a_clock_reference_costs_no_frame() -> None:
    """Between the frames of a slow stream there are some, each a payload of its own."""
    reader, writer, shown = TransportStream(), Writer(), []
    shown += fed(reader, [writer.tables()])
    for number in range(12):
        shown += fed(reader, writer.unit(coded_frame("h264", number, key=number == 0), number * 3000))
        reference = writer.reference(number * 3000)
        if number % 2:
            reader.skip(1)
        else:
            assert reader.feed(reference) == []
    assert numbers(shown) == list(range(12))
    assert (reader.torn, reader.breaks, reader.dropped_units) == (False, 0, 0)


@pytest.mark.parametrize("payloads", [(3,), (1, 2)], ids=str)
def test_so_many_missing_payloads_that_the_counter_may_have_gone_round_are_damage(
    payloads: tuple[int, ...],
) -> None:
    reader, frames = TransportStream(), stream(Writer(), 7)
    fed(reader, frames[0])
    for each in payloads:
        reader.skip(each)
    assert reader.torn
    assert numbers([unit for frame in frames[1:] for unit in fed(reader, frame)]) == [5, 6]


def test_missing_payloads_before_an_announced_discontinuity_are_damage() -> None:
    """The counter begins anew there, and may do so with the number that would be next."""
    reader, frames = TransportStream(), stream(Writer(), 7)
    fed(reader, frames[0])
    last = bytearray(frames[1][-1])
    last[5] |= 0x80
    fed(reader, frames[1][:-1])
    reader.skip(1)
    assert reader.feed(bytes(last)) == []
    assert numbers([unit for frame in frames[2:] for unit in fed(reader, frame)]) == [5, 6]


def test_a_packet_that_comes_twice_counts_once() -> None:
    reader = TransportStream()
    packets = [packet for frame in stream(Writer(), 3) for packet in (*frame, frame[-1])]
    assert numbers(fed(reader, packets)) == [0, 1, 2]


@pytest.mark.parametrize(("byte", "bits"), [(1, 0x80), (3, 0x80)], ids=["transport error", "scrambled"])
def test_a_marked_packet_is_damage(byte: int, bits: int) -> None:
    reader, frames = TransportStream(), stream(Writer(), 7)
    spoilt = bytearray(frames[1][1])
    spoilt[byte] |= bits
    frames[1][1] = bytes(spoilt)
    assert numbers([unit for frame in frames for unit in fed(reader, frame)]) == [0, 5, 6]


def test_the_codec_may_change() -> None:
    reader = TransportStream()
    units = fed(reader, [packet for frame in stream(Writer("h264"), 3) for packet in frame])
    after = Writer("h265", video_pid=0x42)
    units += fed(reader, [packet for frame in stream(after, 3) for packet in frame])
    assert [unit.codec for unit in units] == ["h264"] * 3 + ["h265"] * 3
    assert [unit.first for unit in units] == [True, False, False] * 2


def test_tables_that_are_broken_or_not_yet_valid_are_ignored() -> None:
    reader, writer = TransportStream(), Writer()
    broken = bytearray(writer.tables())
    broken[188 + 20] ^= 1
    reader.feed(bytes(broken))
    reader.feed(Writer("mpeg4").tables(current=False))
    assert fed(reader, Writer().unit(coded_frame("h264", 0, key=True), 0)) == []
    assert numbers(fed(reader, [packet for frame in stream(writer, 1) for packet in frame])) == [0]


def test_other_video_is_named() -> None:
    with pytest.raises(UnknownVideoError, match="video/mpeg"):
        TransportStream().feed(Writer("mpeg4").tables())


def test_sound_alone_is_waited_on() -> None:
    assert TransportStream().feed(Writer("audio").tables()) == []


def test_a_unit_without_a_time_is_shown() -> None:
    reader, writer = TransportStream(), Writer()
    reader.feed(writer.tables())
    (unit,) = fed(reader, writer.unit(coded_frame("h264", 0, key=True), None))
    assert unit.pts_ticks is None


def test_a_unit_that_never_ends_is_dropped() -> None:
    reader, writer = TransportStream(), Writer(sized=False)
    reader.feed(writer.tables())
    fed(reader, writer.unit(coded_frame("h264", 0, key=True, size=5 << 20), 0))
    assert reader.dropped_units == 1
    assert reader.torn


@given(st.binary(max_size=400), st.integers(0, 7))
def test_no_bytes_break_it(noise: bytes, whole: int) -> None:
    """Whatever comes in between, later frames are read, and none that was damaged."""
    reader, writer = TransportStream(), Writer()
    frames = stream(writer, 7)
    units = [unit for frame in frames[:whole] for unit in fed(reader, frame)]
    # A transport stream packet of its own, so that the noise is read as one, too.
    for payload in (noise, b"\x47" + noise[:187].ljust(187, b"\0"), b"\x47\x40\x41" + noise[:185].ljust(185)):
        try:
            units += reader.feed(payload)
        except UnknownVideoError:
            return
    sent = {coded_frame("h264", number, key=number % GOP == 0) for number in range(7)}
    assert {unit.data for unit in units if unit.pts_ticks is not None and len(unit.data) > 300} <= sent


@given(st.sets(st.integers(0, 60)), st.booleans(), st.booleans())
def test_any_loss_leaves_only_decodable_units(lost: set[int], noted: bool, sized: bool) -> None:
    """Each frame that is shown has arrived whole, and so has each one since the key frame before it."""
    reader, index = TransportStream(), 0
    whole: list[bool] = []
    shown: list[AccessUnit] = []
    for frame in stream(Writer(sized=sized), 17):
        whole.append(True)
        for packet in frame:
            index += packet[2] == VIDEO_PID
            if packet[2] == VIDEO_PID and index in lost:
                whole[-1] = False
                if noted:
                    reader.skip(1)
            else:
                shown += reader.feed(packet)
    decodable = [number for number in range(17) if all(whole[number - number % GOP : number + 1])]
    if not noted:
        # Sixteen lost ones in a row can't be seen by the counter.
        assert numbers(shown) == sorted(set(numbers(shown)))
    elif sized:
        assert numbers(shown) == decodable
    else:
        # A unit without length also needs the beginning of the next one.
        assert set(numbers(shown)) <= set(decodable)
