"""What the monitor shows of the stream as this computer receives it, with a real robot's video."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from console.receiver.libsrt import LibsrtMissingError
from console.window.monitor_window import MonitorWindow
from console.window.programs import monitor
from tests.support.qt import until
from tests.support.video_ground import VideoGround, video_ground

pytestmark = pytest.mark.gst


@pytest.fixture
def ground(tmp_path: Path) -> Iterator[VideoGround]:
    with video_ground(tmp_path) as ground:
        ground.switch_on()
        yield ground


def stream_row(window: MonitorWindow) -> str:
    lines = {line.label.text(): line for line in window.side.components.shown}
    line = lines.get("Stream here")
    return f"{line.mark.text()}: {line.text.text()}" if line else ""


def test_the_age_is_plotted_and_delivery_and_link_are_this_windows_own(ground: VideoGround) -> None:
    with monitor(ground.target) as window:
        until(lambda: window.plots.all[0].value_text.endswith(" ms"), "the age in the plot")
        assert window.plots.all[0].accessibleName().startswith("Picture age: ")
        until(lambda: "direct, round trip" in stream_row(window), "the delivery")
        until(lambda: "of the video here" in window.header.link.toolTip(), "the loss of this stream")
        until(lambda: "direct, round trip" in window.header.picture.toolTip(), "the delivery beside the age")


def test_a_fallback_to_the_srt_latency_is_a_warning_with_its_reason(
    ground: VideoGround, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing() -> None:
        raise LibsrtMissingError("libsrt is not installed")

    monkeypatch.setattr("console.receiver.libsrt.load", missing)
    with monitor(ground.target) as window:
        row = until(lambda: stream_row(window), "the delivery")
        why = "libsrt is not installed. Type: sudo apt-get install libsrt1.5-gnutls"
        assert row == f"LATE: SRT latency ({why})"
