"""The window as a person sees it: what is on the (virtual) screen, read back pixel by pixel."""

import re
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from bench.viewer import extra_latency_ms, on_screen
from console.client import GatewayClient
from console.receiver.recording import Recording
from console.viewer.geometry import Box
from console.viewer.playback import PlaybackState
from console.viewer.summary import FrameCounter
from omniseer.gateway.v1 import preview_pb2
from omniseer.gateway.v1 import states_pb2 as states
from tests.support.documented_keys import documented_keys
from tests.support.free import free_tcp_port
from tests.support.gateway_double import GatewayDouble, StreamingGatewayDouble, serving
from tests.support.markup import MARKUP, mark_up, no_widget_takes_markup, shown_by_qt
from tests.support.patient import PATIENT
from tests.support.promise import keeps
from tests.support.qt import KEPT_IN, application, let_pass, pixel_rows, press, until
from tests.support.robotctl import robotctl
from tests.support.running_preview import RunningPreview
from tests.support.undisturbed import no_stall, undisturbed
from tests.support.video_ground import VideoGround, video_ground
from tests.support.waiting import wait_until

from PySide6.QtCore import Qt  # isort: skip - after Qt's platform was chosen
from PySide6.QtGui import QColor, QImage, QShortcut  # isort: skip
from PySide6.QtWidgets import QWidget  # isort: skip

from console.window.programs import viewing
from console.window.view_window import ViewWindow

pytestmark = [pytest.mark.gst, pytest.mark.usefixtures("application")]
__all__ = ["application"]

FPS = 30
FREEZE_SHOWN_WITHIN_S = 0.7
BACK_WITHIN_S = 1.5
HIDDEN_MS = 2000
"""A window is hidden for longer than this: until its last report has ceased to count."""
WATCH_S = 1.0
"""30 frames of each side in each round."""
BOX_YELLOW = QColor("#F0E442")


@pytest.fixture
def view(ground: VideoGround) -> Iterator[ViewWindow]:
    """The window of `robotctl view`, following the robot."""
    with viewing(ground.target, None, FrameCounter()) as view:
        yield view


def shows(view: ViewWindow, state: PlaybackState, within_s: float = 25) -> float:
    until(
        lambda: view.robot.session.playback().state is state,
        f"{state}; it is {view.robot.session.playback()}",
        within_s,
    )
    return time.monotonic()


def keep(widget: QWidget, name: str) -> None:
    folder = KEPT_IN.parent / "view"
    folder.mkdir(parents=True, exist_ok=True)
    assert widget.grab().save(str(folder / f"{name}.png"))


def banner_is_on_screen(view: ViewWindow) -> bool:
    """Whether the card of a banner is painted over the lower part of the frame."""
    video = on_screen(view.video)
    colour = video.pixelColor(video.width() // 2, video.height() - 24)
    return max(colour.red(), colour.green(), colour.blue()) < 60


@pytest.mark.timed
@pytest.mark.alone
def test_the_window_adds_less_than_one_and_a_half_frames_to_the_latency(tmp_path: Path) -> None:
    def extra_frames() -> float:
        return statistics.median(extra_latency_ms(tmp_path, rounds=3, watch_s=WATCH_S)) * FPS / 1000

    keeps(1.5, "frames from decoded to painted", extra_frames, per_stalled_s=FPS)


@pytest.mark.timed
def test_a_freeze_is_painted_at_once_and_gone_when_the_video_is_back(
    ground: VideoGround, view: ViewWindow
) -> None:
    def of_its_limit() -> float:
        shows(view, PlaybackState.LIVE)
        until(lambda: not banner_is_on_screen(view), "the frame alone")
        ground.kill_preview()
        died_s = time.monotonic()
        until(lambda: banner_is_on_screen(view), "the banner")
        frozen_s = time.monotonic() - died_s
        let_pass(0.8)
        keep(view, "frozen")
        shows(view, PlaybackState.FAULTED)
        let_pass(0.3)
        keep(view, "faulted")
        ground.preview.start_again()
        ground.preview.running()
        returned_s = time.monotonic()
        until(lambda: not banner_is_on_screen(view), "the frame alone")
        back_s = time.monotonic() - returned_s
        return max(frozen_s / FREEZE_SHOWN_WITHIN_S, back_s / BACK_WITHIN_S)

    ground.switch_on()
    keeps(
        1.0,
        "time until a freeze is painted, or ends, of its limit",
        of_its_limit,
        per_stalled_s=1 / FREEZE_SHOWN_WITHIN_S,
    )


def test_a_person_switches_the_preview_with_a_key(ground: VideoGround, view: ViewWindow) -> None:
    shows(view, PlaybackState.OFF)
    let_pass(0.6)
    keep(view, "off")
    press(view, Qt.Key.Key_P)
    shows(view, PlaybackState.LIVE)
    until(lambda: "320x240 h264 by avdec_h264" in view.figures.text(), "the figures")
    assert view.windowTitle().endswith(ground.target)
    # The video may be there before the robot's answer: until that has come, no other request is sent.
    until(lambda: not is_asking(view), "the robot's answer")
    press(view, Qt.Key.Key_P)
    shows(view, PlaybackState.OFF)


def is_asking(view: ViewWindow) -> bool:
    """Whether the answer to a request of the window is still to come."""
    request = view.robot.worker.latest().request
    return request is not None and request.pending


def hue_on_screen(view: ViewWindow) -> str:
    """What a plain picture is: red or blue."""
    video = on_screen(view.video)
    colour = video.pixelColor(video.width() // 2, video.height() // 2)
    return "red" if colour.red() > colour.blue() else "blue" if colour.blue() > colour.red() else "none"


@pytest.mark.timeout(300)
def test_a_person_changes_the_camera_with_a_key(tmp_path: Path) -> None:
    cameras = {name: {"kind": "test", "pattern": name} for name in ("red", "blue")}
    with video_ground(tmp_path, {"cameras": cameras}) as ground:

        def attempt() -> None:
            with GatewayClient(ground.target, PATIENT) as client:
                assert client.enable_preview(camera="red").accepted
            # A session redials after a second without a frame.
            with no_stall(), viewing(ground.target, None, FrameCounter()) as view:
                shows(view, PlaybackState.LIVE)
                until(lambda: hue_on_screen(view) == "red", "the first camera")
                press(view, Qt.Key.Key_V)
                until(lambda: hue_on_screen(view) == "blue", "the next camera")
                let_pass(0.3)
                keep(view, "next camera")
                assert view.robot.session.redials == 0, "over the same connection"

        ground.switch_on()
        undisturbed(attempt)


def test_a_person_turns_full_screen_on_and_off_and_quits(view: ViewWindow) -> None:
    shows(view, PlaybackState.OFF)
    press(view, Qt.Key.Key_F)
    until(view.isFullScreen, "full screen")
    assert not view.figures.isVisible()
    press(view, Qt.Key.Key_Escape)
    until(lambda: not view.isFullScreen(), "a window again")
    assert view.figures.isVisible()
    press(view, Qt.Key.Key_Q)
    assert not view.isVisible()


def test_page_and_help_list_every_key() -> None:
    with viewing(f"127.0.0.1:{free_tcp_port()}", None, FrameCounter()) as view:
        bound = {each.key().toString() for each in view.findChildren(QShortcut)}
    assert documented_keys("robotctl.md", "Video: robotctl view") == bound
    listed = re.search(r"Keys: ([^.]+)\.", " ".join(robotctl("view", "--help").stdout.split()))
    assert listed
    # Letters are typed as small ones; two more lead to the full screen and back.
    assert {each.split()[0] for each in listed[1].split(", ")} == {
        name.lower() for name in bound - {"F11", "Esc"}
    }


def test_an_absent_robot_is_reported(tmp_path: Path) -> None:
    with viewing(f"127.0.0.1:{free_tcp_port()}", Recording(tmp_path / "a.ts"), FrameCounter()) as view:
        shows(view, PlaybackState.UNREACHABLE)
        let_pass(0.6)
        keep(view, "unreachable")
        assert view.notes.text().startswith("recording a.ts: 0.0 MiB")


def test_a_window_that_was_busy_paints_the_latest_frame_only(ground: VideoGround, view: ViewWindow) -> None:
    ground.switch_on()
    shows(view, PlaybackState.LIVE)
    before = view.robot.session.frames
    # The window's thread does nothing else meanwhile.
    wait_until(lambda: view.robot.session.frames >= before + 30, "30 frames")
    painted: list[float] = []
    view.video.painted.connect(lambda: painted.append(time.monotonic()))
    let_pass(0.2)
    assert 1 <= len(painted) < 15


@pytest.mark.parametrize("hidden_by", [QWidget.showMinimized, QWidget.hide], ids=["minimised", "hidden"])
def test_a_hidden_window_reports_no_age(
    ground: VideoGround, view: ViewWindow, hidden_by: Callable[[QWidget], None]
) -> None:
    """Its age would only grow, and lower the bit rate of all viewers."""
    ground.switch_on()
    with GatewayClient(ground.target) as client:

        def reporting() -> int | None:
            return client.status().preview.measured.reporting_viewer_count

        until(reporting, "a report")
        hidden_by(view)
        until(lambda: not reporting(), "no report counts any more")
        shows(view, PlaybackState.LIVE)
        assert view.robot.meter.capture_ns() is None, "no one drives by it"
        assert view.robot.meter.summary(), "pictures that were seen"
        view.showNormal()
        until(reporting, "a report of the picture that is shown again")
        worst_ms = client.status().preview.measured.worst_picture_age_ms
        assert worst_ms is not None
        assert worst_ms < HIDDEN_MS


def test_a_refusal_is_shown_in_the_robots_words() -> None:
    double = StreamingGatewayDouble()
    double.accept = False
    with serving(double) as port, viewing(f"127.0.0.1:{port}", None, FrameCounter()) as view:
        shows(view, PlaybackState.OFF)
        press(view, Qt.Key.Key_P)
        until(lambda: "the robot is being serviced" in view.notes.text(), "the robot's words")
        let_pass(0.3)
        keep(view, "refused")
        assert view.robot.session.playback().state is PlaybackState.OFF


@contextmanager
def seeing(
    directory: Path, source: str, *boxes: Box, shape: tuple[int, int]
) -> Iterator[tuple[ViewWindow, GatewayDouble]]:
    """A robot that shows `source` and detects `boxes` in a camera image of this shape."""
    settings = {"source": {"kind": "gst", "description": source}}
    double = StreamingGatewayDouble()
    found = double.overlay.detections
    found.available, found.source_width_px, found.source_height_px = True, *shape
    found.detection_count = len(boxes)
    for box in boxes:
        found.detections.add(
            class_name="box",
            score=0.5,
            bbox_center_x_px=box.x + box.width / 2,
            bbox_center_y_px=box.y + box.height / 2,
            bbox_width_px=box.width,
            bbox_height_px=box.height,
        )
    with RunningPreview(directory, settings) as preview, serving(double) as port:
        preview.enable()
        preview.running()
        shown = double.status.preview
        shown.state = states.PREVIEW_RUNNING
        shown.endpoint.host, shown.endpoint.port, shown.endpoint.latency_ms = "127.0.0.1", preview.port, 20
        shown.endpoint.transport = preview_pb2.STREAM_TRANSPORT_SRT
        shown.endpoint.container = preview_pb2.STREAM_CONTAINER_MPEG_TS
        with viewing(f"127.0.0.1:{port}", None, FrameCounter()) as view:
            yield view, double


def yellow(image: QImage) -> Box | None:
    """What the yellow lines enclose, from the middle of one to the middle of the other; None without any."""
    xs, ys = [], []
    for y, row in enumerate(pixel_rows(image)):
        for x, (red, green, blue) in enumerate(row):
            if abs(red - 240) < 40 and abs(green - 228) < 40 and abs(blue - 66) < 40:
                xs.append(x)
                ys.append(y)
    if not xs:
        return None
    return Box(min(xs) + 1, min(ys) + 1, max(xs) - min(xs) - 1, max(ys) - min(ys) - 1)


def is_about(found: Box, wanted: Box) -> bool:
    return all(
        abs(one - other) <= 2
        for one, other in zip(
            (found.x, found.y, found.right, found.bottom),
            (wanted.x, wanted.y, wanted.right, wanted.bottom),
            strict=True,
        )
    )


BLACK_4_3 = "videotestsrc is-live=true pattern=black ! video/x-raw,width=640,height=480,framerate=30/1"


@pytest.mark.parametrize(
    ("window", "wanted"),
    [
        pytest.param((640, 480), Box(200, 200, 160, 120), id="scaled alone"),
        pytest.param((900, 480), Box(330, 200, 160, 120), id="bars left and right"),
        pytest.param((640, 700), Box(200, 310, 160, 120), id="bars above and below"),
    ],
)
def test_boxes_are_painted_around_what_they_mean(
    tmp_path: Path, window: tuple[int, int], wanted: Box
) -> None:
    """Boxes are in pixels of a 1280x960 camera; the frame is 320x240; the window is another size again."""
    box = Box(400, 400, 320, 240)
    with seeing(tmp_path, BLACK_4_3, box, shape=(1280, 960)) as (view, _double):
        video = view.video
        view.resize(window[0], window[1] + view.height() - video.height())
        shows(view, PlaybackState.LIVE)
        until(lambda: (video.width(), video.height()) == window, "the size")
        # The label's letters are yellow, too, and stand above the box: looked at is the box's own part.
        top = round(wanted.y) - 3

        def painted() -> bool:
            image = on_screen(video).copy(0, top, window[0], window[1] - top)
            found = yellow(image)
            return found is not None and is_about(replace(found, y=found.y + top), wanted)

        until(painted, f"the box at {wanted}")
        video.show_overlay(False)
        until(lambda: yellow(on_screen(video)) is None, "no box")


def test_boxes_fit_a_camera_of_another_shape_than_the_frame(tmp_path: Path) -> None:
    """The robot puts a 16:9 camera into a 4:3 frame with bars; the whole camera image is marked."""
    source = "videotestsrc is-live=true pattern=white ! video/x-raw,width=640,height=360,framerate=30/1"
    with seeing(tmp_path, source, Box(0, 0, 640, 360), shape=(640, 360)) as (view, _double):
        video = view.video
        view.resize(640, 480 + view.height() - video.height())
        shows(view, PlaybackState.LIVE)
        until(lambda: (video.width(), video.height()) == (640, 480), "the size")
        video.show_age(False)  # Its card is over the corner of the box.
        video.show_overlay(False)
        let_pass(0.5)

        def white() -> list[int]:
            bare = on_screen(video)
            return [y for y in range(480) if bare.pixelColor(320, y).lightness() > 128]

        seen = until(white, "the camera's image")
        video.show_overlay(True)

        def framed() -> bool:
            drawn = on_screen(video)
            colours = [(y, drawn.pixelColor(600, y)) for y in range(480)]
            lines = [y for y, colour in colours if colour.blue() < 120 < colour.red()]
            return bool(lines) and abs(min(lines) - min(seen)) <= 2 and abs(max(lines) - max(seen)) <= 2

        until(framed, f"the box from row {min(seen)} to row {max(seen)}")


def test_stale_boxes_are_not_painted(tmp_path: Path) -> None:
    with seeing(tmp_path, BLACK_4_3, Box(400, 400, 320, 240), shape=(1280, 960)) as (view, double):
        video = view.video
        shows(view, PlaybackState.LIVE)
        until(lambda: yellow(on_screen(video)), "the box")
        double.overlay.detections.stale = True
        until(lambda: yellow(on_screen(video)) is None, "no box")


def test_what_the_robot_says_is_never_markup() -> None:
    double = StreamingGatewayDouble()
    mark_up(double.status)
    double.status.preview.endpoint.Clear()
    double.status.preview.state = states.PREVIEW_FAULTED
    with serving(double) as port, viewing(f"127.0.0.1:{port}", None, FrameCounter()) as view:
        until(lambda: MARKUP in view.notes.text(), "the robot's notes")
        assert MARKUP in shown_by_qt(view.notes.toolTip())
        no_widget_takes_markup(view)
