"""Which pictures can have left the robot, as far as its measurements say."""

from dataclasses import replace

import pytest

from gateway.status.preview import Counters, Measurement, PreviewState, PreviewView
from gateway.status.values import Received

NOW_S = 1000.0
NOW_NS = 1_000_000_000_000
MS = 1_000_000


def measurement(age_ms: int, fps: float = 30.0) -> Measurement:
    return Measurement(
        fps=fps,
        bitrate_kbps=600.0,
        viewer_count=1,
        last_frame_age_ms=age_ms,
        worst_rtt_ms=None,
        worst_loss_percent=None,
    )


def running(age_ms: int, fps: float = 30.0, *, measured_s: float = NOW_S) -> PreviewView:
    return PreviewView(
        state=PreviewState.RUNNING,
        profile=None,
        last_error="",
        service_reachable=True,
        listener=None,
        stream=None,
        encoder=None,
        measured=Received(measurement(age_ms, fps), measured_s),
        counters=Counters(),
    )


@pytest.mark.parametrize("fps", [5.0, 15.0, 30.0, 60.0])
@pytest.mark.parametrize("leave_at_ms", [5, 40, 150])
@pytest.mark.parametrize("hiccup_ms", [0, 140])
def test_every_picture_that_leaves_until_the_next_measurement_is_possible(
    fps: float, leave_at_ms: int, hiccup_ms: int
) -> None:
    """Measured right before the next frame, which leaves at the age at which all leave."""
    bound_ns = running(int(leave_at_ms + 1000 / fps + hiccup_ms), fps).newest_capture_ns(NOW_NS)
    assert bound_ns is not None
    assert NOW_NS - leave_at_ms * MS <= bound_ns <= NOW_NS


def test_of_a_camera_that_is_silent_no_new_picture_is_possible() -> None:
    assert running(2000, fps=0.0).newest_capture_ns(NOW_NS) == NOW_NS - 1850 * MS
    assert running(900, fps=10.0).newest_capture_ns(NOW_NS) == NOW_NS - 650 * MS


@pytest.mark.parametrize("state", [each for each in PreviewState if each is not PreviewState.RUNNING])
def test_none_leave_unless_it_runs(state: PreviewState) -> None:
    assert replace(running(20), state=state).newest_capture_ns(NOW_NS) is None


def test_none_are_known_to_leave_without_a_measurement() -> None:
    assert replace(running(20), measured=None).newest_capture_ns(NOW_NS) is None
    assert running(20, measured_s=NOW_S - 2.6).newest_capture_ns(NOW_NS) is None
    assert running(20, measured_s=NOW_S - 2.4).newest_capture_ns(NOW_NS) is not None
