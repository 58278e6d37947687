"""The cockpit: picture first, nothing jumps, each action has a key, everything has a name."""

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import pytest
from PySide6.QtCore import QObject, QPoint, QRect, Qt
from PySide6.QtGui import QImage, QShortcut
from PySide6.QtWidgets import QLabel, QPushButton, QToolButton, QWidget
from shiboken6 import isValid

from common.errors import UserError
from console.monitor.event_log import EventLine
from console.presentation.picture_age import PictureAge
from console.presentation.severity_style import SeverityStyle
from console.robots.robots_file import Robot, RobotsFile
from console.robots.roster import RobotChoice, Roster
from console.window import saver
from console.window.cockpit_keys import KEYS_OF_THE_HANDS, cockpit_keys
from console.window.monitor_window import MonitorWindow
from console.window.programs import monitor
from omniseer.gateway.v1 import preview_pb2, states_pb2, value_pb2
from tests.support.cockpit import (
    PICTURE,
    CockpitRobot,
    resting_robot,
    seeing_robot,
    with_teleop,
    with_trouble,
)
from tests.support.documented_keys import documented_keys
from tests.support.found_robots import FoundRobots
from tests.support.markup import shown_by_qt
from tests.support.qt import keep_screenshot, let_pass, press, until

pytestmark = pytest.mark.gst

WINDOW = (1280, 800)
CLOSED_SHARE, OPEN_SHARE = 0.80, 0.50
"""Least share of the window's pixels that are the picture's own."""
PANEL_PX = 300
CTRL = Qt.KeyboardModifier.ControlModifier
OTHER = RobotChoice("lab2", "10.0.0.2:50051", known=True)
FOUND = RobotChoice("arm & hand", "10.0.0.3:50051", known=False)


@dataclass
class Cockpit:
    """An operator in front of the window."""

    window: MonitorWindow
    robot: CockpitRobot

    def press(self, key: Qt.Key, modifier: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> None:
        press(self.window, key, modifier)

    def sized(self, width: int, height: int) -> None:
        self.window.showNormal()
        self.window.resize(width, height)
        until(lambda: (self.window.width(), self.window.height()) == (width, height), "the size")
        let_pass(0.3)

    def share(self) -> float:
        """The share of the window within the box that the picture is painted in, which must be in sight."""
        image = self.window.grab().toImage()
        box = self.window.video.frame_box()
        origin = self.window.video.mapTo(self.window, self.window.video.rect().topLeft())
        assert origin.x() + box.right <= image.width()
        assert origin.y() + box.bottom <= image.height()
        return box.width * box.height / (image.width() * image.height())

    def where(self) -> dict[str, QRect]:
        """Places of what must not move."""
        window = self.window
        parts: dict[str, QWidget] = {
            "picture": window.video,
            "tabs": window.side.tabs,
            "switch": window.preview.switch,
            "link": window.header.link,
            "clock": window.header.clock,
        }
        return {
            name: QRect(part.mapTo(window, part.rect().topLeft()), part.size())
            for name, part in parts.items()
        }

    def note(self, words: str) -> str:
        return until(lambda: next((n.text for n in self.window.toasts.notes if words in n.text), ""), words)


@contextmanager
def in_front_of(robot: CockpitRobot) -> Iterator[Cockpit]:
    roster = Roster(lambda: RobotsFile(Path("x"), {"lab2": Robot(target=OTHER.target)}), FoundRobots([FOUND]))
    with monitor(robot.target, roster=roster) as window:
        made = Cockpit(window, robot)
        made.sized(*WINDOW)
        until(lambda: window.header.link.word.text().startswith("connected"), "the connection")
        yield made


@pytest.fixture
def cockpit() -> Iterator[Cockpit]:
    """A robot whose preview is off."""
    with resting_robot() as robot, in_front_of(robot) as made:
        yield made


@pytest.fixture
def seeing(tmp_path: Path) -> Iterator[Cockpit]:
    """A robot with live video."""
    (tmp_path / "robot").mkdir()
    with seeing_robot(tmp_path / "robot") as robot, in_front_of(robot) as made:
        painted: list[None] = []
        made.window.video.painted.connect(lambda: painted.append(None))
        until(lambda: len(painted) > 3, "the picture")
        yield made


@pytest.mark.parametrize("teleop", [False, True], ids=["status only", "with driving"])
def test_the_picture_fills_the_window(seeing: Cockpit, teleop: bool) -> None:
    cockpit = seeing
    if teleop:
        with_teleop(cockpit.robot.gateway)
        until(cockpit.window.strip.driving.isVisible, "the place of driving")
        let_pass(0.3)
    assert cockpit.share() >= OPEN_SHARE
    assert cockpit.window.side.width() == PANEL_PX
    cockpit.press(Qt.Key.Key_F9)
    let_pass(0.3)
    assert cockpit.share() >= CLOSED_SHARE
    keep_screenshot(cockpit.window, f"panel-closed{'-driving' if teleop else ''}")
    cockpit.press(Qt.Key.Key_F9)
    let_pass(0.3)
    assert cockpit.share() >= OPEN_SHARE


def test_the_picture_alone_and_back(cockpit: Cockpit) -> None:
    before = cockpit.where()
    cockpit.press(Qt.Key.Key_F)
    let_pass(0.3)
    assert cockpit.window.video.size() == cockpit.window.size()
    keep_screenshot(cockpit.window, "picture-only")
    cockpit.press(Qt.Key.Key_Escape)
    let_pass(0.3)
    assert cockpit.where() == before


def test_where_a_robot_is_driven_stop_keeps_its_place(cockpit: Cockpit) -> None:
    stop = cockpit.window.strip.driving.stop_place
    assert not stop.isVisible()
    with_teleop(cockpit.robot.gateway)
    until(stop.isVisible, "the place of STOP")

    def place() -> QRect:
        let_pass(0.3)
        return QRect(stop.mapTo(cockpit.window, stop.rect().topLeft()), stop.size())

    first = place()
    for key in (Qt.Key.Key_F9, Qt.Key.Key_F9, Qt.Key.Key_F, Qt.Key.Key_F):
        cockpit.press(key)
        assert place() == first
        assert stop.isVisible()
    assert not stop.findChildren(QPushButton), "no button that does nothing"


def test_plots_are_a_tab_in_a_narrow_window(cockpit: Cockpit) -> None:
    side, plots = cockpit.window.side, cockpit.window.plots
    tab = side.tabs.indexOf(side.plots)
    assert plots.isVisible()
    assert not side.tabs.isTabVisible(tab)
    cockpit.sized(1099, 700)
    assert not plots.isVisible()
    cockpit.press(Qt.Key.Key_3, CTRL)
    assert side.plots.isVisible()
    keep_screenshot(cockpit.window, "plots-tab")
    cockpit.sized(1100, 700)
    assert plots.isVisible()
    assert not side.tabs.isTabVisible(tab)


def test_nothing_jumps(cockpit: Cockpit) -> None:
    window, before = cockpit.window, cockpit.where()
    cockpit.robot.gateway.status.preview.last_error = "the camera was busy " * 5
    with_trouble(cockpit.robot.gateway)
    until(lambda: len(window.side.faults.shown) == 3, "the faults")
    cockpit.robot.gateway.accept = False
    cockpit.press(Qt.Key.Key_P)
    cockpit.note("The robot refused")
    keep_screenshot(window, "trouble")
    assert cockpit.where() == before
    cockpit.robot.gateway.hold.clear()
    until(window.banner.isVisible, "the banner of a lost connection")
    let_pass(0.3)
    least = 2 * window.fontMetrics().height()
    assert window.banner.height() >= least, "the error, and the next attempt"
    assert window.banner.button.height() >= window.fontMetrics().height()
    top, below = window.banner.geometry().bottom(), window.toasts.geometry().top()
    assert below > top, "the answer is not covered"
    assert window.picture.trail.geometry().top() > top, "nor is the trail"
    assert window.toasts.height() >= window.fontMetrics().height()
    keep_screenshot(window, "banner")
    assert cockpit.where() == before
    cockpit.robot.gateway.hold.set()
    until(window.banner.isHidden, "back again")


def test_nothing_looks_alive_while_the_robot_does_not_answer(cockpit: Cockpit) -> None:
    window, robot = cockpit.window, cockpit.robot.gateway
    with_teleop(robot)
    robot.status.preview.last_error = "the camera was busy"
    place = window.strip.driving
    until(lambda: place.state.text() == "Driving enabled" and place.drive.isEnabled(), "driving")
    until(
        lambda: [note.marker.severity for note in window.side.notes.shown] == [SeverityStyle.WARNING], "note"
    )
    robot.hold.clear()
    until(lambda: place.state.text() == "Driving enabled, last known", "what was last known")
    assert not place.drive.isEnabled()
    assert place.stop_place.isEnabled(), "STOP works whatever is known"
    assert window.header.mode.detail.text() == "last known"
    assert [note.marker.severity for note in window.side.notes.shown] == [SeverityStyle.QUIET]
    robot.hold.set()
    until(lambda: place.state.text() == "Driving enabled" and place.drive.isEnabled(), "it answers again")


def test_driving_is_disabled_and_enabled_again_in_the_menu_of_drive(cockpit: Cockpit) -> None:
    with_teleop(cockpit.robot.gateway)
    teleop, place = cockpit.robot.gateway.status.teleop, cockpit.window.strip.driving
    until(place.isVisible, "the place of driving")
    for state, entry, other in (
        (states_pb2.TELEOP_ENABLED, place.disable, place.enable),
        (states_pb2.TELEOP_DISABLED, place.enable, place.disable),
    ):
        teleop.state, teleop.enabled = state, state == states_pb2.TELEOP_ENABLED
        until(lambda: entry.isEnabled() and not other.isEnabled(), "what can be chosen")  # noqa: B023  # at once
        assert place.drive.isEnabled(), "its menu can be opened"
        assert (place.drive.popupMode() is QToolButton.ToolButtonPopupMode.InstantPopup) is not teleop.enabled
        entry.trigger()
        cockpit.note(f"Driving is not {'disabled' if teleop.enabled else 'enabled'}")


def test_a_message_is_closed_with_esc(cockpit: Cockpit) -> None:
    cockpit.robot.gateway.accept = False
    cockpit.press(Qt.Key.Key_P)
    cockpit.note("The robot refused")
    cockpit.press(Qt.Key.Key_Escape)
    until(lambda: not cockpit.window.toasts.notes, "no message")
    let_pass(0.6)
    assert not cockpit.window.toasts.notes
    cockpit.press(Qt.Key.Key_P)
    cockpit.note("The robot refused")


def test_gauges_and_trail_stand_in_the_corners_of_the_picture(seeing: Cockpit) -> None:
    cockpit = seeing
    picture = cockpit.window.picture
    until(picture.speed.isVisible, "the gauges")
    until(picture.trail.isVisible, "the robot has moved")
    assert (picture.speed.value_text, picture.turn.value_text) == ("0.50", "+0.30")
    cockpit.sized(1000, 800)
    cockpit.press(Qt.Key.Key_F9)
    let_pass(0.3)
    box = cockpit.window.video.frame_box()
    corners = {
        picture.speed: (box.x, box.bottom),
        picture.turn: (box.right, box.bottom),
        picture.trail: (box.right, box.y),
    }
    for overlay, (x, y) in corners.items():
        shown = overlay.geometry()
        assert min(abs(shown.left() - x), abs(shown.right() + 1 - x)) <= 9, overlay.accessibleName()
        assert min(abs(shown.top() - y), abs(shown.bottom() + 1 - y)) <= 9, overlay.accessibleName()
    with_trouble(cockpit.robot.gateway)
    until(lambda: "stale" in picture.speed.accessibleName(), "an old speed is marked")


def test_the_bar_says_it_at_a_glance(cockpit: Cockpit) -> None:
    bar = cockpit.window.header
    assert bar.height() == 48
    until(lambda: bar.battery.word.text() == "78 %", "the battery")
    until(lambda: bar.picture.word.text() == "118 ms", "the age of the picture")
    assert bar.mode.word.text() == "manual"
    assert "Wi-Fi -58 dBm" in bar.link.detail.text()
    with_trouble(cockpit.robot.gateway)
    until(lambda: bar.battery.detail.text().startswith("LOW"), "a low battery")
    assert bar.health.detail.text().startswith("1 error, 1 warning")


def test_values_that_only_the_configuration_names_stand_in_the_status(cockpit: Cockpit) -> None:
    def shown() -> dict[str, tuple[str, str]]:
        lines = cockpit.window.side.components.shown
        return {line.label.text(): (line.mark.text(), line.text.text()) for line in lines}

    status = cockpit.robot.gateway.status
    number = status.numbers.add(title="Left motor", available=True, value=96, unit="°C", decimals=1)
    number.level = value_pb2.NUMBER_LEVEL_ERROR_HIGH
    status.texts.add(
        title="<b>gripper</b>", available=True, text="jammed", level=value_pb2.TEXT_LEVEL_WARNING
    )
    until(lambda: "Left motor" in shown(), "the number")
    assert shown()["Left motor"] == ("TOO HIGH", "96.0\u00a0°C")
    assert shown()["<b>gripper</b>"] == ("WARNING", "jammed")


def test_another_reading_of_the_pictures_age_may_be_given(cockpit: Cockpit) -> None:
    shown = cockpit.window.header.picture
    cockpit.window.read_picture_age = lambda: PictureAge(83.4, 5.0, "link")
    until(lambda: shown.word.text() == "83 \u00b1 5 ms", "the reading")
    cockpit.window.read_picture_age = lambda: None
    until(lambda: shown.word.text() == "118 ms", "what another viewer reports")
    assert shown.detail.text() == "oldest of other viewers"
    cockpit.robot.gateway.status.preview.measured.ClearField("worst_picture_age_ms")
    until(lambda: shown.word.text() == "-", "no reading")


def test_a_picture_is_saved_with_its_status(
    seeing: Cockpit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cockpit = seeing
    monkeypatch.setattr(saver, "folder", lambda: tmp_path / "new")
    cockpit.press(Qt.Key.Key_S)
    cockpit.note("Saved")
    (picture,) = (tmp_path / "new").glob("lab-1-*.png")
    image = QImage(str(picture))
    assert (image.width(), image.height()) == PICTURE
    record = json.loads(picture.with_suffix(".json").read_text(encoding="utf-8"))
    assert record["status"]["platform"]["power"]["lipo_battery"]["charge_percent"] == 78
    assert record["picture"]["age"] is None, "the robot's figure is of another window's picture"


def test_a_picture_that_can_not_be_saved_is_reported(
    seeing: Cockpit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cockpit = seeing
    occupied = tmp_path / "occupied"
    occupied.write_text("a file, no folder")
    monkeypatch.setattr(saver, "folder", lambda: occupied)
    cockpit.press(Qt.Key.Key_S)
    cockpit.note("Not saved")


def test_without_a_picture_nothing_is_saved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(saver, "folder", lambda: tmp_path / "new")
    with monitor("127.0.0.1:9") as window:
        press(window, Qt.Key.Key_S)
        until(lambda: any("no picture" in note.text for note in window.toasts.notes), "why")
    assert not (tmp_path / "new").exists()


def test_a_fault_is_acknowledged_and_the_alarm_falls_silent(cockpit: Cockpit) -> None:
    window, played = cockpit.window, threading.Event()
    window.sound.play = played.set
    with_trouble(cockpit.robot.gateway)
    until(lambda: window.alarm.pending == 2, "both faults wait")
    let_pass(0.6)
    assert not played.is_set(), "the sound is off by default"
    cockpit.press(Qt.Key.Key_M)
    until(played.is_set, "the alarm is heard")
    first = window.side.faults.shown[0]
    first.button.click()
    until(lambda: window.alarm.pending == 1, "one is acknowledged")
    assert not first.button.isVisible()
    cockpit.press(Qt.Key.Key_A)
    until(lambda: window.alarm.pending == 0, "all are acknowledged")
    let_pass(0.3)
    played.clear()
    let_pass(3.5)
    assert not played.is_set()


def test_a_lost_connection_alarms_until_it_is_acknowledged(cockpit: Cockpit) -> None:
    window, played = cockpit.window, threading.Event()
    window.sound.play = played.set
    cockpit.press(Qt.Key.Key_M)
    cockpit.robot.gateway.hold.clear()
    until(played.is_set, "the loss is heard")
    assert window.banner.acknowledge.isVisible()
    assert window.side.acknowledge.isEnabled()
    keep_screenshot(window, "lost-connection-alarm")
    window.banner.acknowledge.click()
    until(lambda: window.alarm.pending == 0 and not window.banner.acknowledge.isVisible(), "it is muted")
    assert window.banner.isVisible()
    cockpit.robot.gateway.hold.set()
    until(window.banner.isHidden, "back again")
    cockpit.robot.gateway.hold.clear()
    until(window.banner.acknowledge.isVisible, "the next loss alarms again")
    cockpit.press(Qt.Key.Key_A)
    until(lambda: not window.banner.acknowledge.isVisible(), "by its key as well")


def test_a_sound_device_that_fails_is_reported(cockpit: Cockpit) -> None:
    def fail() -> None:
        raise UserError("no alarm can be heard: no such device", "Check this computer's sound device")

    cockpit.window.sound.play = fail
    with_trouble(cockpit.robot.gateway)
    cockpit.press(Qt.Key.Key_M)
    cockpit.note("no alarm can be heard")


def test_a_new_fault_appears_over_the_picture_while_the_panel_is_closed(cockpit: Cockpit) -> None:
    cockpit.press(Qt.Key.Key_F9)
    with_trouble(cockpit.robot.gateway)
    cockpit.note("odometry stopped coming on /odom")


def test_a_cleared_fault_is_one_grey_line(cockpit: Cockpit) -> None:
    with_trouble(cockpit.robot.gateway)
    until(lambda: len(cockpit.window.side.faults.shown) == 3, "the faults")
    let_pass(0.3)
    active, _, cleared = cockpit.window.side.faults.shown
    assert cleared.mark.text() == "cleared"
    assert not cleared.text.isVisible()
    assert cleared.height() < 2 * cleared.fontMetrics().height()
    assert active.height() > 3 * active.fontMetrics().height()


def test_events_are_searched_filtered_and_exported(
    cockpit: Cockpit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(saver, "folder", lambda: tmp_path)
    window = cockpit.window
    events = window.side.events_tab
    log = window._worker.latest().events.with_lines(  # the double streams no events
        [
            EventLine(1.0, "preview running, BALANCED"),
            EventLine(2.0, "warning: disk: nearly full", SeverityStyle.WARNING),
            EventLine(3.0, "error: lidar: stopped", SeverityStyle.BAD),
            EventLine(4.0, "anna joined", presence=True),
        ]
    )
    events.list.show_log(log)
    assert len(events.list.lines) == 3
    events.presence.setChecked(True)
    assert events.list.lines[0].endswith("anna joined")
    zone = datetime.fromtimestamp(4.0).astimezone().strftime("%Z")
    assert shown_by_qt(events.list.item(0).toolTip()).endswith(f":04 {zone}")
    events.presence.setChecked(False)
    cockpit.press(Qt.Key.Key_F, CTRL)
    until(events.search.hasFocus, "the search has the focus")
    events.search.setText("LIDAR")
    assert len(events.list.lines) == 1
    events.search.clear()
    events.severity.setCurrentIndex(1)
    assert len(events.list.lines) == 2
    cockpit.press(Qt.Key.Key_E, CTRL)
    cockpit.note("Saved 2 events")
    (file,) = tmp_path.glob("*.events.jsonl")
    assert [json.loads(line)["severity"] for line in file.read_text().splitlines()] == ["warning", "error"]
    keep_screenshot(window, "events")


@pytest.mark.parametrize("key", [Qt.Key.Key_F1, Qt.Key.Key_Question])
def test_the_keys_are_shown(cockpit: Cockpit, key: Qt.Key) -> None:
    keys = cockpit.window.picture.key_help
    cockpit.press(key)
    until(keys.isVisible, "the list of keys")
    let_pass(0.2)
    assert cockpit.window.picture.rect().contains(keys.geometry())
    keep_screenshot(cockpit.window, "keys")
    cockpit.press(Qt.Key.Key_Escape)
    assert not keys.isVisible()


@pytest.mark.parametrize("size", [(1024, 600), WINDOW], ids=str)
def test_every_key_can_be_read_in_a_small_window(cockpit: Cockpit, size: tuple[int, int]) -> None:
    """None is cut off at the right, and those below are reached with the keyboard alone."""
    cockpit.sized(*size)
    picture, keys = cockpit.window.picture, cockpit.window.picture.key_help
    cockpit.press(Qt.Key.Key_F1)
    until(keys.isVisible, "the list of keys")
    let_pass(0.3)
    assert picture.rect().contains(keys.geometry())
    keep_screenshot(cockpit.window, f"keys-{size[0]}x{size[1]}")
    view, content = keys.area.viewport(), keys.area.widget()
    assert content
    labels = content.findChildren(QLabel)
    texts = {label.text() for label in labels}
    assert texts > {key.does for key in cockpit_keys(cockpit.window, cockpit.window)}
    assert all(label.width() >= label.sizeHint().width() for label in labels)

    def read() -> set[str]:
        boxes = ((each.text(), QRect(each.mapTo(view, QPoint()), each.size())) for each in labels)
        return {text for text, box in boxes if view.rect().contains(box)}

    assert keys.area.hasFocus()
    seen = read()
    for _ in range(10):
        press(keys.area, Qt.Key.Key_PageDown)
        seen |= read()
    assert seen == texts


def test_the_list_of_keys_gives_the_focus_back(cockpit: Cockpit) -> None:
    """Letters typed afterwards are keys again, not text."""
    window = cockpit.window
    window.preview.switch.setFocus()
    cockpit.press(Qt.Key.Key_F1)
    until(window.picture.key_help.area.hasFocus, "the list has it")
    cockpit.press(Qt.Key.Key_Escape)
    until(window.preview.switch.hasFocus, "the button has it again")
    window.preview.switch.clearFocus()
    cockpit.press(Qt.Key.Key_F1)
    cockpit.press(Qt.Key.Key_F1)
    assert window.focusWidget() is None


def test_every_key_of_the_list_is_bound_and_no_key_twice(cockpit: Cockpit) -> None:
    listed = [name for key in cockpit_keys(cockpit.window, cockpit.window) for name in key.names]
    bound = [each.key().toString() for each in cockpit.window.findChildren(QShortcut)]
    assert sorted(listed) == sorted(bound)
    assert len(set(listed)) == len(listed)


def test_the_page_lists_every_key(cockpit: Cockpit) -> None:
    listed = {name for key in cockpit_keys(cockpit.window, cockpit.window) for name in key.names}
    hands = {name for key in KEYS_OF_THE_HANDS for name in key.names}
    of_qt = {"Tab", "Alt and the underlined letter"}
    # Those two are in the sentence above the table.
    assert documented_keys("monitor.md", "Keys") == (listed - {"F1", "?"}) | hands | of_qt


def test_cameras_are_chosen_by_key_and_menu(cockpit: Cockpit) -> None:
    gateway, menu = cockpit.robot.gateway, cockpit.window.preview.camera
    assert not menu.isVisible(), "a robot with one camera has no choice"
    preview = gateway.status.preview
    preview.state, preview.wanted_camera = states_pb2.PREVIEW_RUNNING, "front & centre"
    live, ready, failed = (
        preview_pb2.CAMERA_STATE_LIVE,
        preview_pb2.CAMERA_STATE_READY,
        preview_pb2.CAMERA_STATE_FAILED,
    )
    for name, state in (("front & centre", live), ("arm", failed), ("rear", ready)):
        preview.cameras.add(name=name, state=state, error="unplugged" if state == failed else "")
    until(menu.isVisible, "the menu")
    assert menu.text() == "front && centre"
    assert "front & centre" in menu.accessibleName()
    let_pass(0.3)
    keep_screenshot(cockpit.window, "cameras")
    cockpit.press(Qt.Key.Key_V)
    until(lambda: gateway.preview_requests, "the request")
    assert (gateway.preview_requests[-1].enabled, gateway.preview_requests[-1].camera) == (True, "rear")
    until(menu.isEnabled, "the answer")
    menu.fill()
    actions = menu.cameras.actions()
    assert [action.text() for action in actions] == ["front && centre", "arm  (does not work)", "rear"]
    assert [action.isChecked() for action in actions] == [True, False, False]
    assert shown_by_qt(actions[1].toolTip()) == "unplugged"
    # What does not work may be asked for: the robot then tries it at once.
    actions[1].trigger()
    until(lambda: len(gateway.preview_requests) == 2, "the second request")
    assert gateway.preview_requests[-1].camera == "arm"
    until(menu.isEnabled, "the answer")
    preview.state = states_pb2.PREVIEW_DISABLED
    until(lambda: cockpit.window.preview.switch.text() == "&Start preview", "it is off")
    cockpit.press(Qt.Key.Key_V)
    until(lambda: menu.text() == "rear", "it is selected for the next start")
    assert len(gateway.preview_requests) == 2
    cockpit.press(Qt.Key.Key_P)
    until(lambda: len(gateway.preview_requests) == 3, "the start")
    assert gateway.preview_requests[-1].camera == "rear"


def test_letters_typed_into_the_search_are_no_keys(cockpit: Cockpit) -> None:
    cockpit.press(Qt.Key.Key_F, CTRL)
    search = cockpit.window.side.events_tab.search
    until(search.hasFocus, "the search has the focus")
    asked = len(cockpit.robot.gateway.preview_requests)
    for key in (Qt.Key.Key_P, Qt.Key.Key_Q, Qt.Key.Key_S, Qt.Key.Key_1):
        press(search, key)
    assert search.text() == "pqs1"
    assert cockpit.window.isVisible()
    assert len(cockpit.robot.gateway.preview_requests) == asked


def test_everything_that_takes_the_focus_has_a_name_for_screen_readers(cockpit: Cockpit) -> None:
    window = cockpit.window
    with_trouble(cockpit.robot.gateway)
    until(lambda: len(window.side.faults.shown) == 3, "the faults")
    cockpit.sized(1024, 600)
    for tab in range(3):
        window.side.show_tab(tab)
        let_pass(0.2)
        nameless = [
            each
            for each in window.findChildren(QWidget)
            if each.isVisible()
            and each.focusPolicy() is not Qt.FocusPolicy.NoFocus
            and not (each.accessibleName() or (isinstance(each, QPushButton | QLabel) and each.text()))
        ]
        assert not nameless
    picture = window.picture
    painted = (window.video, picture.speed, picture.turn, picture.trail, *window.side.plots.all)
    assert all(each.accessibleName() for each in painted)


def test_the_switcher_lists_known_and_discovered_robots(cockpit: Cockpit) -> None:
    menu = cockpit.window.header.name.robots
    cockpit.window.header.name.fill()
    texts = [action.text() for action in menu.actions()]
    assert texts == ["lab2  (10.0.0.2:50051)", "arm && hand  (10.0.0.3:50051, found on the network)"]
    menu.actions()[1].trigger()
    until(lambda: not cockpit.window.isVisible(), "this window is closed")
    assert cockpit.window.next_robot == FOUND


def test_a_window_is_gone_before_its_program_goes_on() -> None:
    """Left to the garbage collector, it may end in any thread, which aborts the process."""
    with resting_robot() as robot, monitor(robot.target) as window:
        let_pass(0.3)
        parts: list[QObject] = [window, *window.findChildren(QObject)]
    assert not any(isValid(part) for part in parts)
