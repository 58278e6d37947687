import os
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from console.receiver.delivery import Delivery, DeliveryChoice
from console.receiver.frame import Frame
from console.receiver.recording import Recording
from console.viewer.formatting import delivery_text, figures_line, recording_line
from console.viewer.summary import FrameCounter
from tests.unit.console.receiver.frames import frame

MIB = 1 << 20


def frame_at(at_s: float, *, corrupt: bool = False) -> Frame:
    return replace(frame(), arrival_s=at_s, corrupt=corrupt, decoder="avdec_h264")


def kept(tmp_path: Path) -> Recording:
    with closing(Recording(tmp_path / "drive.ts")) as recording:
        os.write(recording.pipe, bytes(MIB))
    return recording


def test_without_a_frame_the_figures_are_empty() -> None:
    summary = FrameCounter().summary(0, None)
    assert summary.line() == "no frame"
    assert (summary.pictures, summary.width_px, summary.first_picture_ms, summary.fps) == (
        0,
        None,
        None,
        None,
    )


def test_frames_are_counted_and_their_rate_is_that_between_first_and_last() -> None:
    counter = FrameCounter()
    begun_s = counter.last_s
    for number in range(31):
        counter.count(frame_at(begun_s + 0.25 + number / 30, corrupt=number == 3))
    summary = counter.summary(2, None)
    assert (summary.pictures, summary.corrupt_pictures, summary.redials) == (31, 1, 2)
    assert summary.fps == pytest.approx(30)
    assert summary.first_picture_ms == 250
    assert summary.line() == (
        "31 frames, 6x4 h264 by avdec_h264, first after 250 ms, 30.0 fps, 1 corrupt, reconnected 2x"
    )
    assert counter.last_s == pytest.approx(begun_s + 1.25)


def test_one_frame_has_no_rate() -> None:
    counter = FrameCounter()
    counter.count(frame_at(counter.last_s))
    assert counter.summary(0, None).fps is None


def test_the_recording_is_in_the_summary(tmp_path: Path) -> None:
    recording = kept(tmp_path)
    summary = FrameCounter().summary(0, recording)
    assert summary.recording == {"file": str(recording.file), "bytes": MIB, "gaps": 0}
    assert summary.line() == f"no frame, {recording.file}: 1.0 MiB"
    recording.add_gap()
    assert "with 1 gap: the disk was too slow" in FrameCounter().summary(0, recording).line()


def test_the_line_below_the_video() -> None:
    assert figures_line(None, 0, 0) == ""
    assert figures_line(None, 0, 3) == "reconnected 3x"
    newest = replace(frame(), decoder="vah264dec")
    assert figures_line(newest, 29.7, 1) == "6x4 h264 by vah264dec, 30 fps, reconnected 1x"


def test_the_text_of_the_delivery() -> None:
    assert delivery_text(None) == ""
    direct = Delivery(kind=DeliveryChoice.DIRECT, rtt_ms=20.3, given_up=2, rejoins=1)
    assert delivery_text(direct) == "direct, round trip 20 ms, 2 packets given up, rejoined 1x"
    remedy = "Type: sudo apt-get install libsrt1.5-gnutls"
    fallback = Delivery(kind=DeliveryChoice.SRT, reason="libsrt is not installed", remedy=remedy)
    assert delivery_text(fallback) == f"SRT latency (libsrt is not installed. {remedy})"
    assert delivery_text(Delivery(kind=DeliveryChoice.SRT)) == "SRT latency"


def test_the_line_of_the_recording(tmp_path: Path) -> None:
    assert recording_line(None) == ""
    recording = kept(tmp_path)
    assert recording_line(recording) == "recording drive.ts: 1.0 MiB"
    recording.add_gap()
    assert recording_line(recording).endswith(", 1 gap")


def test_the_line_of_a_recording_that_ended_early() -> None:
    with closing(Recording(Path("/dev/full"))) as recording:
        os.write(recording.pipe, bytes(188))
    assert "ended early: No space left" in recording_line(recording)
