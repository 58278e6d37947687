"""How old the picture is, and why: the figures of the way from the camera to the screen."""

from dataclasses import replace

import pytest

from console.client.results import PreviewMeasurement, PreviewState, PreviewStatus, VideoFormat
from console.presentation.severity_style import SeverityStyle
from console.receiver.delivery import Delivery, DeliveryChoice
from console.viewer.picture_reading import AgeCause, PictureReading, ShownPicture, reading
from tests.unit.console.viewer.previews import preview

NOW_S = 1000.0
DIRECT = Delivery(kind=DeliveryChoice.DIRECT, rtt_ms=20.4, loss_percent=1.25)


def robot(last_frame_age_ms: int | None, measured_age_ms: int = 300, fps: float = 30.0) -> PreviewStatus:
    """A robot whose newest frame was so old `measured_age_ms` ago, when its figures were taken."""
    newest = None if last_frame_age_ms is None else last_frame_age_ms + measured_age_ms
    known = preview(PreviewState.RUNNING)
    measured: PreviewMeasurement = replace(
        known.measured, available=True, stale=False, age_ms=measured_age_ms, last_frame_age_ms=newest
    )
    return replace(known, measured=measured, video=VideoFormat(width_px=1280, height_px=720, fps=fps))


def shown(age_ms: float, *, since_s: float = 0.01, own_ms: float | None = 5.0) -> ShownPicture:
    return ShownPicture(NOW_S - since_s, age_ms, 0.4, own_ms, capture_ns=1)


def test_a_young_picture_has_no_cause() -> None:
    found = reading(shown(18.2), DIRECT, robot(20), NOW_S)
    assert found == PictureReading(age_ms=18.2, error_ms=0.4, rtt_ms=20.4, loss_percent=1.25)
    assert found.style is SeverityStyle.GOOD
    assert found.age_text == "18 ms \u00b1 1"
    assert found.link_text == "round trip 20 ms, loss 1.2 %"


@pytest.mark.parametrize(
    ("picture", "robot_ms", "cause"),
    [
        (shown(300), 20, AgeCause.LINK),
        (shown(300), None, AgeCause.LINK),
        (shown(300, own_ms=None), 20, AgeCause.LINK),
        (shown(300), 280, AgeCause.ENCODER),
        (shown(300, own_ms=250), 20, AgeCause.DECODER),
        # Nothing newer is there in time: neither here nor on the robot; or on the robot alone.
        (shown(30, since_s=0.5), 400, AgeCause.CAMERA),
        (shown(30, since_s=0.5), 20, AgeCause.LINK),
        (shown(30, since_s=0.5), None, AgeCause.LINK),
    ],
)
def test_the_longest_part_of_the_way_is_the_cause(
    picture: ShownPicture, robot_ms: int | None, cause: AgeCause
) -> None:
    found = reading(picture, DIRECT, robot(robot_ms), NOW_S)
    assert found.cause is cause
    assert found.age_text.endswith(f" - {cause.value}")
    assert found.style is not SeverityStyle.GOOD


def test_the_age_grows_while_no_newer_picture_comes() -> None:
    ages_ms = [reading(shown(30, since_s=since_s), None, None, NOW_S).age_ms for since_s in (0.09, 0.2, 2)]
    assert ages_ms == pytest.approx([30, 230, 2030])


@pytest.mark.parametrize(
    ("age_ms", "style"),
    [(149.0, SeverityStyle.GOOD), (150.0, SeverityStyle.WARNING), (400.0, SeverityStyle.BAD)],
)
def test_the_age_is_coloured_where_it_hurts_driving(age_ms: float, style: SeverityStyle) -> None:
    assert reading(shown(age_ms), DIRECT, None, NOW_S).style is style


def test_without_a_picture_the_link_alone_is_known() -> None:
    found = reading(None, DIRECT, None, NOW_S)
    assert found == PictureReading(rtt_ms=20.4, loss_percent=1.25)
    assert (found.style, found.age_text) == (SeverityStyle.QUIET, "")
    assert reading(None, None, None, NOW_S).link_text == ""


def test_stale_figures_of_the_robot_blame_nothing() -> None:
    old = robot(900)
    old = replace(old, measured=replace(old.measured, stale=True))
    assert reading(shown(300), DIRECT, old, NOW_S).cause is AgeCause.LINK
