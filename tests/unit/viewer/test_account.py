import os
from dataclasses import replace
from pathlib import Path

import pytest

from console.receiver.frame import Frame
from console.receiver.recording import Recording
from console.viewer.account import Bookkeeper
from console.viewer.words import figures_line, recording_line
from tests.unit.receiver.frames import frame

MIB = 1 << 20


def picture(at_s: float, *, corrupt: bool = False) -> Frame:
    return replace(frame(), arrival_s=at_s, corrupt=corrupt, decoder="avdec_h264")


def kept(tmp_path: Path) -> Recording:
    with Recording(tmp_path / "drive.ts") as recording:
        os.write(recording.pipe, bytes(MIB))
    return recording


def test_without_a_picture_nothing_is_made_up() -> None:
    account = Bookkeeper().account(0, None)
    assert account.line() == "no picture"
    assert (account.pictures, account.width_px, account.first_picture_ms, account.fps) == (
        0,
        None,
        None,
        None,
    )


def test_pictures_are_counted_and_their_rate_is_that_between_first_and_last() -> None:
    books = Bookkeeper()
    begun_s = books.last_s
    for number in range(31):
        books.note(picture(begun_s + 0.25 + number / 30, corrupt=number == 3))
    account = books.account(2, None)
    assert (account.pictures, account.corrupt_pictures, account.redials) == (31, 1, 2)
    assert account.fps == pytest.approx(30)
    assert account.first_picture_ms == 250
    assert account.line() == (
        "31 pictures, 6x4 h264 by avdec_h264, first after 250 ms, 30.0 fps, 1 corrupt, called again 2x"
    )
    assert books.last_s == pytest.approx(begun_s + 1.25)


def test_one_picture_has_no_rate() -> None:
    books = Bookkeeper()
    books.note(picture(books.last_s))
    assert books.account(0, None).fps is None


def test_the_recording_is_told(tmp_path: Path) -> None:
    recording = kept(tmp_path)
    account = Bookkeeper().account(0, recording)
    assert account.recording == {"file": str(recording.file), "bytes": MIB, "gaps": 0}
    assert account.line() == f"no picture, {recording.file}: 1.0 MiB"
    recording.add_gap()
    assert "with 1 gap: the disk was too slow" in Bookkeeper().account(0, recording).line()


def test_the_line_below_the_picture() -> None:
    assert figures_line(None, 0, 0) == ""
    assert figures_line(None, 0, 3) == "called again 3x"
    newest = replace(frame(), decoder="vah264dec")
    assert figures_line(newest, 29.7, 1) == "6x4 h264 by vah264dec, 30 fps, called again 1x"


def test_the_line_of_the_recording(tmp_path: Path) -> None:
    assert recording_line(None) == ""
    recording = kept(tmp_path)
    assert recording_line(recording) == "recording drive.ts: 1.0 MiB"
    recording.add_gap()
    assert recording_line(recording).endswith(", 1 gap")


def test_the_line_of_a_recording_that_ended_early() -> None:
    with Recording(Path("/dev/full")) as recording:
        os.write(recording.pipe, bytes(188))
    assert "ended early: No space left" in recording_line(recording)
