"""The ring's files on a real disk: links of them, and what a failing disk leaves."""

import errno
import os
import time
from dataclasses import replace
from pathlib import Path

import pytest

from recorder.mcap.writer import SegmentWriter
from recorder.store.ring import Ring, link
from recorder.values import Gap, GapCause
from tests.support.segments import string_sample

NS_PER_S = 1_000_000_000


@pytest.fixture
def source(tmp_path: Path) -> Path:
    source = tmp_path / "00000000.mcap"
    source.write_bytes(b"a segment")
    return source


def test_a_link_whose_folder_was_not_synchronised_can_be_made_again(
    source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = source.with_name("000000.mcap")

    def broken(_directory: Path) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    with monkeypatch.context() as patched:
        patched.setattr("recorder.store.ring.sync_directory", broken)
        with pytest.raises(OSError, match="Input/output"):
            link(source, target)
    link(source, target)
    assert target.samefile(source)


@pytest.mark.parametrize("code", [errno.EXDEV, errno.EPERM, errno.EMLINK])
def test_where_there_are_no_links_it_is_a_copy(
    source: Path, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    def refused(_source: Path, _target: Path) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(os, "link", refused)
    target = source.with_name("000000.mcap")
    link(source, target)
    assert target.read_bytes() == b"a segment"
    assert not target.samefile(source)


def test_what_a_clock_that_was_set_back_has_in_the_future_is_kept_no_longer(tmp_path: Path) -> None:
    """A computer without a clock of its own starts with the time of its last shutdown, or an older one."""
    writer = SegmentWriter(tmp_path / "00000007.mcap.part")
    later_ns = time.time_ns() + 3600 * NS_PER_S
    writer.write(replace(string_sample(1), log_time_ns=later_ns))
    writer.finish()
    ring = Ring(tmp_path, seconds=60)
    ring.load()
    now_ns = time.monotonic_ns()
    assert 0 <= ring.held_ns(now_ns) <= 60 * NS_PER_S
    assert ring.outdated(now_ns + 59 * NS_PER_S) == []
    assert ring.outdated(now_ns + 61 * NS_PER_S) == ring.segments
    assert ring.within(now_ns - 30 * NS_PER_S, now_ns) == [], "it is not what has just been"


def test_what_was_left_an_hour_ago_is_kept_as_long_as_what_is_new(tmp_path: Path) -> None:
    """What led to a power cut is wanted when the robot is on again."""
    writer = SegmentWriter(tmp_path / "00000007.mcap.part")
    writer.write(string_sample(1))
    writer.finish()
    ring = Ring(tmp_path, seconds=60)
    ring.load()
    now_ns = time.monotonic_ns()
    assert ring.outdated(now_ns + 59 * NS_PER_S) == []
    assert ring.outdated(now_ns + 61 * NS_PER_S) == ring.segments
    assert ring.next_number == 8


def filled(directory: Path, number: int, chunks: int = 3) -> Path:
    """Writes a final segment of 10 messages in each chunk, its own second after that of the one before."""
    part = directory / f"{number:08d}.mcap.part"
    writer = SegmentWriter(part)
    for each in range(chunks * 10):
        sample = string_sample(each)
        writer.write(replace(sample, log_time_ns=sample.log_time_ns + number * NS_PER_S))
        if each % 10 == 9:
            writer.flush()
    writer.finish()
    return part.with_suffix("")


def times_of(ring: Ring, index: int) -> tuple[int, int]:
    """When the first and the last message of a segment were logged."""
    summary = ring.segments[index].summary
    assert summary.first_ns
    assert summary.last_ns
    return summary.first_ns, summary.last_ns


def loaded(directory: Path) -> Ring:
    ring = Ring(directory, seconds=60)
    ring.load()
    return ring


@pytest.mark.parametrize("kept", [0.0, 0.5], ids=["nothing", "half"])
def test_a_segment_that_was_damaged_is_made_whole_and_what_it_lacks_is_known(
    tmp_path: Path, kept: float
) -> None:
    """The defect: it was deleted without a word."""
    paths = [filled(tmp_path, number) for number in range(3)]
    assert loaded(tmp_path).losses() == ()
    size = paths[1].stat().st_size
    with paths[1].open("r+b") as file:
        file.seek(round(kept * size))
        file.write(b"\xff" * (size - round(kept * size)))
    ring = loaded(tmp_path)
    numbers = [each.number for each in ring.segments]
    assert numbers == ([0, 1, 2] if kept else [0, 2])
    assert paths[1].exists() == bool(kept)
    left = sum(each.summary.messages for each in ring.segments)
    assert left == 60 if not kept else 60 < left < 90
    last_before_ns, first_behind_ns = times_of(ring, -2)[1], times_of(ring, -1)[0]
    assert ring.losses() == (Gap("", GapCause.DISK, last_before_ns, first_behind_ns, None),)
    assert not list(tmp_path.glob("*.part"))
    if not kept:
        gap = replace(ring.losses()[0], cause=GapCause.INTERRUPTED)
        assert loaded(tmp_path).losses() == (gap,), "the next process knows it from the number"


def test_what_the_newest_or_the_oldest_has_lost_is_no_gap_between_others(tmp_path: Path) -> None:
    paths = [filled(tmp_path, number) for number in range(3)]
    for path in (paths[0], paths[2]):
        path.write_bytes(b"\xff" * 1000)
    ring = loaded(tmp_path)
    assert [each.number for each in ring.segments] == [1]
    assert ring.next_number == 3
    assert ring.losses() == ()


def test_the_next_process_knows_when_the_ring_was_not_written(tmp_path: Path) -> None:
    filled(tmp_path, 0)
    ring = loaded(tmp_path)
    ring.skip()
    filled(tmp_path, ring.next_number)
    filled(tmp_path, ring.next_number + 1)
    ring = loaded(tmp_path)
    assert [each.number for each in ring.segments] == [0, 2, 3]
    assert ring.losses() == (Gap("", GapCause.INTERRUPTED, times_of(ring, 0)[1], times_of(ring, 1)[0], None),)
