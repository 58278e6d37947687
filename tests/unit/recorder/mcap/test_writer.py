"""Segments as independent readers see them, and what becomes of a disk's errors."""

import errno
import hashlib
import os
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.records import ChunkIndex

from recorder.mcap.recovery import recover
from recorder.mcap.writer import MAX_CHUNK, SegmentWriter
from recorder.values import GapCause, Loss, Note
from tests.support.segments import BYTE, STRING, indexed_log_times, linear_log_times, string_sample


def chunks_of(path: Path) -> list[ChunkIndex]:
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary
    return summary.chunk_indexes


def test_a_finished_segment_has_what_was_written(tmp_path: Path) -> None:
    writer = SegmentWriter(tmp_path / "000000.mcap.part", head=[Note("clock", {"boot": "1"})])
    samples = [string_sample(number, channel=BYTE if number % 2 else STRING) for number in range(5)]
    for sample in samples:
        writer.write(sample)
    writer.loss(Loss(STRING, GapCause.MIDDLEWARE, 1, 2, 3))
    writer.flush()
    summary = writer.finish()
    assert summary.path == tmp_path / "000000.mcap"
    assert list(tmp_path.iterdir()) == [summary.path]
    content = summary.path.read_bytes()
    assert (summary.size, summary.sha256) == (len(content), hashlib.sha256(content).hexdigest())
    assert (summary.messages, [each.messages for each in summary.channels]) == (5, [3, 2])
    assert (summary.first_ns, summary.last_ns) == (samples[0].log_time_ns, samples[-1].log_time_ns)
    assert [(each.topic, each.messages) for each in summary.gaps] == [("/chatter", 3)]
    with summary.path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        header = reader.get_header()
        assert header.profile == "ros2"
        assert header.library.startswith("robot-gateway ")
        read = [(channel.topic, message) for _, channel, message in reader.iter_messages()]
        assert [each.name for each in reader.iter_metadata()] == ["clock", "gap"]
    assert [topic for topic, _ in read] == [each.channel.topic for each in samples]
    for (_, message), sample in zip(read, samples, strict=True):
        assert message.data == sample.data
        assert message.sequence == sample.sequence
        assert (message.log_time, message.publish_time) == (sample.log_time_ns, sample.publish_time_ns)


def test_chunks_are_bounded_and_a_larger_message_is_a_chunk_of_its_own(tmp_path: Path) -> None:
    writer = SegmentWriter(tmp_path / "0.mcap.part")
    sizes = [1000, 600_000, 600_000, 8_000_000, 1000, 1000]
    for number, size in enumerate(sizes):
        writer.write(string_sample(number, "x" * size))
    path = writer.finish().path
    uncompressed = [each.uncompressed_size for each in chunks_of(path)]
    assert [each < MAX_CHUNK + 1000 for each in uncompressed] == [True, True, False, True]
    assert len(indexed_log_times(path)) == len(linear_log_times(path)) == len(sizes)


def test_after_a_flush_everything_is_in_the_file(tmp_path: Path) -> None:
    part = tmp_path / "0.mcap.part"
    writer = SegmentWriter(part)
    writer.write(string_sample(1))
    writer.flush()
    copy = tmp_path / "copy.mcap.part"
    copy.write_bytes(part.read_bytes())
    writer.abandon()
    recovered = recover(copy)
    assert recovered
    assert recovered.messages == 1


def test_times_may_go_back(tmp_path: Path) -> None:
    """The calendar clock was set."""
    writer = SegmentWriter(tmp_path / "0.mcap.part")
    for number in (5, 2, 9):
        writer.write(string_sample(number))
    summary = writer.finish()
    assert (summary.first_ns, summary.last_ns) == (1_000_000_002, 1_000_000_009)
    assert indexed_log_times(summary.path) == [1_000_000_002, 1_000_000_005, 1_000_000_009]


def test_a_segment_without_messages_is_a_whole_file(tmp_path: Path) -> None:
    summary = SegmentWriter(tmp_path / "0.mcap.part").finish()
    assert (summary.messages, summary.first_ns, summary.channels) == (0, None, ())
    assert indexed_log_times(summary.path) == []


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    part, final = tmp_path / "0.mcap.part", tmp_path / "0.mcap"
    writer = SegmentWriter(part)
    with pytest.raises(FileExistsError):
        SegmentWriter(part)
    final.write_text("another's")
    with pytest.raises(FileExistsError):
        writer.finish()
    assert final.read_text() == "another's"
    assert part.exists()


def test_a_full_disk_is_an_oserror_and_leaves_what_was_flushed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer = SegmentWriter(tmp_path / "0.mcap.part")
    writer.write(string_sample(1))
    writer.flush()
    writer.write(string_sample(2))
    write = os.write
    room = 50

    def full(handle: int, data: Any) -> int:
        nonlocal room
        if not room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        written = write(handle, data[:room])
        room -= written
        return written

    with monkeypatch.context() as patched:
        patched.setattr(os, "write", full)
        with pytest.raises(OSError, match="No space left") as raised:
            writer.flush()
    assert raised.value.errno == errno.ENOSPC
    writer.abandon()
    writer.abandon()
    recovered = recover(tmp_path / "0.mcap.part")
    assert recovered
    assert recovered.messages == 1


def test_a_file_that_can_not_be_begun_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_handle: int, _data: Any) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    before = len(list(Path("/proc/self/fd").iterdir()))
    with monkeypatch.context() as patched:
        patched.setattr(os, "write", full)
        with pytest.raises(OSError, match="No space left"):
            SegmentWriter(tmp_path / "0.mcap.part")
    assert len(list(Path("/proc/self/fd").iterdir())) == before
    assert not list(tmp_path.iterdir())
