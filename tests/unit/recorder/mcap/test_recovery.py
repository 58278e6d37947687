"""What is left of a segment after a power failure or a bad block, as independent readers see it."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader

from recorder.mcap.reading import summarise
from recorder.mcap.recovery import recover
from recorder.mcap.writer import SegmentWriter
from recorder.values import VIDEO_TOPIC, Channel, GapCause, Loss, Note, SegmentSummary
from tests.support.segments import (
    STRING,
    indexed_log_times,
    linear_log_times,
    string_sample,
    unfinished_segment,
)

CHUNKS = (2, 3, 4)
VIDEO = replace(STRING, topic=VIDEO_TOPIC)
FIRST_NS = 1_000_000_000
TYPE = re.compile(r"[a-z][a-z0-9_]*/msg/[A-Z][A-Za-z0-9]*")


@pytest.fixture(scope="module")
def unfinished(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("unfinished")
    return unfinished_segment(
        folder / "a.mcap.part", CHUNKS, head=[Note("clock", {"boot": "1"})]
    ).read_bytes()


@pytest.fixture(scope="module")
def chunk_ends(tmp_path_factory: pytest.TempPathFactory) -> list[int]:
    """Sizes of the file after each chunk, without and with its message indexes."""
    folder = tmp_path_factory.mktemp("ends")
    return [
        unfinished_segment(folder / f"{count}.mcap.part", CHUNKS[:count], head=[Note("clock", {"boot": "1"})])
        .stat()
        .st_size
        for count in range(len(CHUNKS) + 1)
    ]


def recovered(folder: Path, content: bytes) -> SegmentSummary | None:
    for old in folder.iterdir():
        old.unlink()
    part = folder / "0.mcap.part"
    part.write_bytes(content)
    summary = recover(part)
    assert part.exists() == (summary is None)
    return summary


def assert_readable(summary: SegmentSummary) -> list[int]:
    """Returns the log times, on which three readers agree."""
    times = indexed_log_times(summary.path)
    assert sorted(linear_log_times(summary.path)) == times
    with Reader(summary.path) as reader:
        assert [at_ns for _, at_ns, _ in reader.messages()] == times
    assert summary.messages == len(times) == sum(each.messages for each in summary.channels)
    assert (summary.first_ns, summary.last_ns) == (times[0], times[-1])
    assert summary.size == summary.path.stat().st_size
    assert_rosbag2_opens(summary.path)
    return times


def assert_rosbag2_opens(path: Path) -> None:
    """As read_metadata() of its mcap_storage.cpp: one channel without a schema costs it the whole file."""
    with path.open("rb") as file:
        index = make_reader(file).get_summary()
    assert index
    for channel in index.channels.values():
        schema = index.schemas.get(channel.schema_id)
        assert schema, f"Could not find schema for topic {channel.topic}"
        assert TYPE.fullmatch(schema.name), "with another name `ros2 bag play` has nothing to look for"


def expected(numbers: range) -> list[int]:
    return [FIRST_NS + number for number in numbers]


def test_a_segment_cut_at_any_byte_keeps_every_whole_chunk(tmp_path: Path, unfinished: bytes) -> None:
    kept: list[int] = []
    for cut in range(len(unfinished) + 1):
        summary = recovered(tmp_path, unfinished[:cut])
        times = assert_readable(summary) if summary else []
        assert times in ([], *(expected(range(sum(CHUNKS[:count]))) for count in (1, 2, 3)))
        assert len(times) >= (kept[-1] if kept else 0)
        kept.append(len(times))
    assert kept[0] == 0
    assert kept[-1] == sum(CHUNKS)


def test_whole_chunks_need_no_message_index(tmp_path: Path, unfinished: bytes, chunk_ends: list[int]) -> None:
    """The indexes of the second chunk are 78 bytes, one record of two messages and one of one."""
    summary = recovered(tmp_path, unfinished[: chunk_ends[2] - 70])
    assert summary
    assert assert_readable(summary) == expected(range(5))


@pytest.mark.parametrize("tail", [bytes(4096), b"\xff" * 5000, b"\6" * 100, b"\x0c" + bytes(8) + bytes(50)])
def test_what_was_never_written_is_cut(tmp_path: Path, unfinished: bytes, tail: bytes) -> None:
    """Zeros are what ext4 leaves of blocks that were allocated and not written before a power failure."""
    summary = recovered(tmp_path, unfinished + tail)
    assert summary
    assert assert_readable(summary) == expected(range(9))
    assert not summary.gaps


def test_a_bad_block_in_the_middle_is_a_gap(tmp_path: Path, unfinished: bytes, chunk_ends: list[int]) -> None:
    damaged = bytearray(unfinished)
    damaged[chunk_ends[1] + 70] ^= 1
    summary = recovered(tmp_path, bytes(damaged))
    assert summary
    assert assert_readable(summary) == expected(range(2)) + expected(range(5, 9))
    (gap,) = summary.gaps
    assert (gap.cause, gap.began_ns, gap.ended_ns) == (GapCause.DISK, FIRST_NS + 1, FIRST_NS + 5)
    assert gap.messages is None
    with summary.path.open("rb") as file:
        assert [each.name for each in make_reader(file).iter_metadata()] == ["clock", "gap"]


@pytest.mark.parametrize(
    "harm",
    [
        lambda head: bytes(len(head)),
        lambda head: b"x" + head[1:],
        lambda head: head.replace(b"robot-gateway", b"robot-gat\x9fway"),
    ],
    ids=["zeros", "magic", "no text"],
)
def test_a_damaged_beginning_costs_no_whole_chunk_behind_it(
    tmp_path: Path, unfinished: bytes, chunk_ends: list[int], harm: Callable[[bytes], bytes]
) -> None:
    head = chunk_ends[0]
    summary = recovered(tmp_path, harm(unfinished[:head]) + unfinished[head:])
    assert summary
    assert assert_readable(summary) == expected(range(9))


def test_messages_whose_channel_is_unknown_stay(
    tmp_path: Path, unfinished: bytes, chunk_ends: list[int]
) -> None:
    damaged = bytearray(unfinished)
    damaged[chunk_ends[0] + 70] ^= 1
    summary = recovered(tmp_path, bytes(damaged))
    assert summary
    assert assert_readable(summary) == expected(range(2, 9))
    assert {(each.topic, each.type) for each in summary.channels} == {
        ("/byte", "std_msgs/msg/Byte"),
        ("/unknown/channel_1", "unknown/msg/Unknown"),
    }
    assert summarise(summary.path) == summary
    once = summary.path.read_bytes()
    again = recovered(tmp_path, once)
    assert again
    assert again.path.read_bytes() == once


def test_messages_whose_type_is_unknown_stay(tmp_path: Path) -> None:
    """A type is defined once in a file, with the first of its topics."""
    part = tmp_path / "0.mcap.part"
    writer = SegmentWriter(part)
    begin = part.stat().st_size
    writer.write(string_sample(0))
    writer.flush()
    for number in (1, 2):
        writer.write(string_sample(number, channel=replace(STRING, topic=f"/other_{number}")))
    writer.flush()
    writer.abandon()
    damaged = bytearray(part.read_bytes())
    damaged[begin + 70] ^= 1
    summary = recovered(tmp_path, bytes(damaged))
    assert summary
    assert assert_readable(summary) == expected(range(1, 3))
    assert {(each.topic, each.type) for each in summary.channels} == {
        ("/other_1", "unknown/msg/Unknown"),
        ("/other_2", "unknown/msg/Unknown"),
    }
    assert summarise(summary.path) == summary


def test_gaps_written_before_stay_and_repeating_changes_nothing(
    tmp_path: Path, chunk_ends: list[int], unfinished: bytes
) -> None:
    damaged = bytearray(unfinished)
    damaged[chunk_ends[1] + 70] ^= 1
    first = recovered(tmp_path, bytes(damaged))
    assert first
    once = first.path.read_bytes()
    for cut in (len(once), len(once) - 20, len(once) - 200, chunk_ends[3] + 30):
        again = recovered(tmp_path, once[:cut])
        assert again
        assert again.path.read_bytes() == once
        assert again.sha256 == first.sha256
        assert again.gaps == first.gaps


@pytest.mark.parametrize(
    ("sequences", "of", "numbered"),
    [((1, 2), STRING, True), ((0, 0), STRING, False), ((1, 0), STRING, False), ((0, 0), VIDEO, True)],
    ids=["numbered", "not numbered", "one of both", "video"],
)
def test_whether_messages_are_numbered_is_known_however_a_file_ends(
    tmp_path: Path, sequences: Sequence[int], of: Channel, numbered: bool
) -> None:
    """Without numbers no loss is counted, which must not read as no loss."""
    finished = SegmentWriter(tmp_path / "000000.mcap.part")
    cut = SegmentWriter(tmp_path / "000001.mcap.part")
    for number, sequence in enumerate(sequences):
        for writer in (finished, cut):
            writer.write(replace(string_sample(number, channel=of), sequence=sequence))
    summary = finished.finish()
    assert (summary.numbered, summary.messages) == (numbered, len(sequences))
    assert summarise(summary.path) == summary
    cut.flush()
    cut.abandon()
    found = recover(tmp_path / "000001.mcap.part")
    assert found
    assert (found.numbered, found.messages) == (numbered, len(sequences))
    assert summarise(found.path) == found


def test_losses_are_reported_again(tmp_path: Path) -> None:
    writer = SegmentWriter(tmp_path / "0.mcap.part")
    writer.write(string_sample(0))
    writer.loss(Loss(STRING, GapCause.MIDDLEWARE, 1, 2, 3))
    writer.loss(Loss(None, GapCause.VIDEO, 4, 5, None))
    writer.flush()
    writer.abandon()
    summary = recover(tmp_path / "0.mcap.part")
    assert summary
    assert [(each.topic, each.cause, each.messages) for each in summary.gaps] == [
        ("/chatter", GapCause.MIDDLEWARE, 3),
        ("", GapCause.VIDEO, None),
    ]


@pytest.mark.parametrize("chunks", [(), (0,)])
def test_a_segment_without_messages_is_left_alone(tmp_path: Path, chunks: tuple[int, ...]) -> None:
    part = unfinished_segment(tmp_path / "0.mcap.part", chunks, head=[Note("clock", {"boot": "1"})])
    before = part.read_bytes()
    assert recover(part) is None
    assert part.read_bytes() == before


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    part = unfinished_segment(tmp_path / "0.mcap.part", CHUNKS)
    (tmp_path / "0.mcap").write_text("another's")
    with pytest.raises(FileExistsError):
        recover(part)
    assert (tmp_path / "0.mcap").read_text() == "another's"
    (tmp_path / "0.mcap").unlink()
    summary = recover(part)
    assert summary
    assert summary.messages == 9


@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_damage_leaves_a_readable_file(tmp_path: Path, unfinished: bytes, data: st.DataObject) -> None:
    damaged = bytearray(unfinished)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(damaged) - 1))
        length = data.draw(st.integers(1, 64))
        harm = data.draw(st.one_of(st.just(bytes(length)), st.binary(min_size=1, max_size=length)))
        damaged[at : at + len(harm)] = harm
    summary = recovered(tmp_path, bytes(damaged))
    if summary:
        times = indexed_log_times(summary.path)
        assert times == sorted(set(times))
        assert set(times) <= set(expected(range(9)))
        assert summary.messages == len(times)
        assert_rosbag2_opens(summary.path)


@given(content=st.binary(max_size=2000))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_file_that_is_no_segment_is_left_alone(tmp_path: Path, content: bytes) -> None:
    assert recovered(tmp_path, content) is None
    assert (tmp_path / "0.mcap.part").read_bytes() == content
