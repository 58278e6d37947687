"""Values of the robot's own choice over the picture: in place, in order, and never over anything else."""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtWidgets import QWidget

from console.presentation.preview_switch import Note
from console.presentation.severity_style import SeverityStyle
from console.window.monitor_window import MonitorWindow
from console.window.programs import monitor
from console.window.value_tiles import TILE_PX
from omniseer.gateway.v1 import value_pb2
from tests.support.cockpit import CockpitRobot, resting_robot, seeing_robot, with_teleop, with_tiles
from tests.support.qt import keep_screenshot, let_pass, press, until

pytestmark = pytest.mark.gst

ALL = ["Left motor temperature", "Cell 3", "Gripper", "CO2", "Winch load", "Depth"]


@pytest.fixture
def robot() -> Iterator[CockpitRobot]:
    with resting_robot() as made:
        yield made


@pytest.fixture
def window(robot: CockpitRobot) -> Iterator[MonitorWindow]:
    with monitor(robot.target) as made:
        sized(made, 1280, 800)
        with_tiles(robot.gateway)
        until(lambda: titles(made) == ALL, "the tiles")
        yield made


def sized(window: MonitorWindow, width: int, height: int) -> None:
    window.showNormal()
    window.resize(width, height)
    until(lambda: (window.width(), window.height()) == (width, height), "the size")
    let_pass(0.3)


def titles(window: MonitorWindow) -> list[str]:
    """From below."""
    return [tile.shown.title for tile in window.picture.values.tiles if tile.isVisible() and tile.shown]


def places(window: MonitorWindow) -> list[QRect]:
    """In the picture area, from below."""
    return [place_of(window, tile) for tile in window.picture.values.tiles if tile.isVisible()]


def place_of(window: MonitorWindow, part: QWidget) -> QRect:
    return QRect(part.mapTo(window.picture, QPoint(0, 0)), part.size())


def leave_room_for(window: MonitorWindow, count: int) -> None:
    """Makes the head-up display as tall as that takes."""
    hud, needed = window.picture.hud, count * (TILE_PX + 4) + 2 * 8
    hud.resize(hud.width(), window.picture.speed.y() - hud.y() - needed)
    window.picture.place()


def test_they_stand_above_the_speed_from_below_in_the_order_of_the_configuration(
    window: MonitorWindow,
) -> None:
    speed, found = window.picture.speed.geometry(), places(window)
    assert found[0].bottom() < speed.top()
    assert all(upper.bottom() < lower.top() for lower, upper in pairwise(found))
    assert {(place.left(), place.width()) for place in found} == {(speed.left(), found[0].width())}


def test_each_has_a_name_with_its_level_and_its_age(window: MonitorWindow) -> None:
    names = [tile.accessibleName() for tile in window.picture.values.tiles]
    assert names[0] == "Left motor temperature: 96.0 \u00b0C, TOO HIGH"
    assert names[2] == "Gripper: holding parcel 12, waiting for the lift"
    assert names[4] == "Winch load: -, no data"
    assert names[5].startswith("Depth: 1.25 m, STALE, 2 min 0")


def test_nothing_jumps_when_values_change(window: MonitorWindow, robot: CockpitRobot) -> None:
    before, motor = places(window), window.picture.values.tiles[0]
    number = robot.gateway.status.numbers[0]
    number.value, number.level = -123456.789, value_pb2.NUMBER_LEVEL_ERROR_LOW
    until(lambda: motor.shown and motor.shown.value == "-123456.8 \u00b0C", "a long value")
    assert places(window) == before
    number.value, number.level = 7, value_pb2.NUMBER_LEVEL_GOOD
    until(lambda: motor.shown and motor.shown.value == "7.0 \u00b0C", "a short one")
    assert places(window) == before
    assert motor.shown
    assert motor.shown.style is SeverityStyle.QUIET


def test_all_is_stale_while_the_robot_is_silent(window: MonitorWindow, robot: CockpitRobot) -> None:
    before = places(window)
    robot.gateway.hold.clear()
    marks = ["STALE", "STALE", "STALE", "STALE", "no data", "STALE"]
    tiles = window.picture.values.tiles
    until(lambda: [tile.shown.mark for tile in tiles if tile.shown] == marks, "old values")
    assert all(tile.shown and tile.shown.dim for tile in tiles)
    assert places(window) == before, "the banner of the lost connection moves none"
    robot.gateway.hold.set()
    until(lambda: tiles[0].shown and tiles[0].shown.mark == "TOO HIGH", "it answers again")


def test_they_stay_in_the_picture_alone(window: MonitorWindow) -> None:
    press(window, Qt.Key.Key_F)
    let_pass(0.3)
    assert titles(window) == ALL


def test_they_cover_neither_driver_nor_message_and_the_worst_stay_where_few_fit(
    window: MonitorWindow, robot: CockpitRobot
) -> None:
    with_teleop(robot.gateway)
    until(window.picture.hud.isVisible, "the head-up display")
    window.toasts.show_passing(Note("a message as long as messages can be, " * 4, SeverityStyle.WARNING))
    for height in (600, 540):
        sized(window, 1024, height)
        others = [window.picture.hud, window.toasts, window.picture.speed]
        assert all(part.isVisible() for part in others)
        for part in others:
            assert not any(place.intersects(part.geometry()) for place in places(window)), part
    leave_room_for(window, 3)
    assert titles(window) == ["Left motor temperature", "Cell 3", "Depth"]
    leave_room_for(window, 1)
    assert titles(window) == ["Left motor temperature"]


def test_in_a_window_without_room_there_are_none(window: MonitorWindow) -> None:
    window.picture.hud.setVisible(True)
    window.picture.hud.resize(272, 2000)
    window.picture.place()
    assert titles(window) == []
    window.picture.hud.setVisible(False)
    window.picture.place()
    assert titles(window) == ALL


def test_a_robot_that_asks_for_none_has_none(robot: CockpitRobot) -> None:
    with monitor(robot.target) as window:
        until(window.picture.speed.isVisible, "a status")
        assert window.picture.values.isHidden()


def test_they_stand_inside_the_picture_and_not_in_its_letterbox(tmp_path: Path) -> None:
    with seeing_robot(tmp_path) as robot, monitor(robot.target) as window:
        with_tiles(robot.gateway)
        until(lambda: titles(window), "the tiles")
        until(lambda: window.video.latest_image() is not None, "the picture")
        press(window, Qt.Key.Key_F)
        for width, height in ((1000, 800), (1400, 600)):
            sized(window, width, height)
            box = window.video.frame_box()
            assert box.y + box.x > 50, "there is a letterbox"
            inside = QRect(round(box.x), round(box.y), round(box.width), round(box.height))
            assert all(inside.contains(place) for place in places(window))
            assert len(places(window)) == len(ALL)
            keep_screenshot(window, f"tiles-letterbox-{width}")
