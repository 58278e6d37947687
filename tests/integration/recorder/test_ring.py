"""The ring's files on a real disk: links of them, and what a failing disk leaves."""

import errno
import os
import time
from dataclasses import replace
from pathlib import Path

import pytest

from recorder.mcap.writer import SegmentWriter
from recorder.store.ring import Ring, link
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
