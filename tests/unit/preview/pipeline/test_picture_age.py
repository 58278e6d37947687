"""Which of the ages that viewers report say something of their links."""

import pytest

from preview.pipeline.adaptive import BitrateController, Sample, ViewerLink
from preview.pipeline.picture_age import PictureAge

WINDOW_S = 0.6
FAST_MS = 20.0


@pytest.fixture
def age() -> PictureAge:
    return PictureAge()


def test_a_report_counts_for_three_seconds(age: PictureAge) -> None:
    assert age.counting(100.0) is None
    age.take(140, 100.0)
    assert age.counting(102.9) == 140
    assert age.counting(103.0) is None


def test_frames_that_the_robot_makes_in_time_leave_it_to_the_viewers(age: PictureAge) -> None:
    age.note_newest(150.0, 100.0)
    age.take(900, 100.0)
    assert age.counting(100.0) == 900


def test_while_the_camera_stands_still_and_shortly_after_no_age_counts(age: PictureAge) -> None:
    """The gateway may pass on for 3 s what a viewer reported of the stall."""
    age.note_newest(151.0, 100.0)
    age.take(400, 100.0)
    assert age.counting(100.0) is None
    age.note_newest(10.0, 100.2)
    age.take(400, 102.9)
    assert age.counting(102.9) is None
    age.take(40, 103.0)
    assert age.counting(103.0) == 40


@pytest.mark.parametrize(("newest_ms", "falls"), [(FAST_MS, True), (900.0, False)], ids=["link", "camera"])
def test_the_bit_rate_falls_for_a_link_and_not_for_a_camera(
    age: PictureAge, newest_ms: float, falls: bool
) -> None:
    """The same report of pictures that are suddenly 900 ms old."""
    controller, now = BitrateController(2500, 500), 100.0
    for old_ms, frame_ms in [(40, FAST_MS)] * 5 + [(900, newest_ms)] * 3 + [(40, FAST_MS)] * 5:
        age.note_newest(frame_ms, now)
        age.take(old_ms, now)
        decision = controller.decide(Sample(2500, {"a:1": ViewerLink(20.0)}, age.counting(now)), now)
        now += WINDOW_S
    assert (decision.bitrate_kbps < 2500) is falls
