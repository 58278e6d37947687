"""The monitor window at a robot with authentication: roles, a revoked login, and a new one."""

import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from PySide6.QtCore import Qt

from console.window.monitor_window import MonitorWindow
from console.window.programs import monitor
from gateway.access.credential import Kind
from gateway.access.role import Role
from tests.support.guarded_program import Guarded, guarded_program, guarded_video
from tests.support.promise import keeps
from tests.support.qt import keep_screenshot, let_pass, press, until

pytestmark = pytest.mark.gst

REVOKED_SHOWN_WITHIN_S = 2.0
SHOWN_WITHIN_S = 10.0
"""For what no time is promised of."""
WATCHED_S = 4.0
MOST_ATTEMPTS = 2
"""In WATCHED_S: at once, the next after 5 s. With the backoff of a silent robot it would be 4."""


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Guarded]:
    with guarded_video(tmp_path_factory.mktemp("robot"), tmp_path_factory.mktemp("laptop")) as robot:
        yield robot


@dataclass
class Person:
    """In front of the window."""

    window: MonitorWindow

    def link_is(self, word: str) -> None:
        until(
            lambda: self.window.header.link.word.text() == word, f"the connection is {word}", SHOWN_WITHIN_S
        )

    def preview_is(self, word: str) -> None:
        until(lambda: self.window.preview.state.word.text() == word, f"the preview is {word}")

    def press_p(self) -> None:
        until(self.window.preview.switch.isEnabled, "the controls may be touched")
        press(self.window, Qt.Key.Key_P)

    def notes(self) -> str:
        return " ".join(note.text for note in self.window.toasts.notes)

    def events(self) -> str:
        return "\n".join(self.window.side.events.lines)

    def video_moves(self) -> None:
        painted: list[float] = []
        connection = self.window.video.painted.connect(lambda: painted.append(time.monotonic()))
        until(lambda: len(painted) >= 15, "15 frames are painted")
        self.window.video.painted.disconnect(connection)


@contextmanager
def in_front_of(robot: Guarded) -> Iterator[Person]:
    """The window, with the login that the laptop has."""
    with monitor(robot.target, robot.stored) as window:
        person = Person(window)
        person.link_is("connected")
        yield person


def test_an_operator_sees_everything_and_switches(robot: Guarded) -> None:
    robot.log_in("anna", Role.OPERATOR)
    with in_front_of(robot) as anna:
        assert anna.window.header.name.text() == "lab-1"
        anna.press_p()
        anna.preview_is("RUNNING")
        anna.video_moves()
        until(lambda: "anna" in anna.events(), "who switched it on is an event")
        anna.press_p()
        anna.preview_is("DISABLED")


def test_a_viewer_sees_which_role_is_missing_and_goes_on_watching(robot: Guarded) -> None:
    robot.switch_on()
    robot.log_in("ben", Role.VIEWER)
    with in_front_of(robot) as ben:
        ben.preview_is("RUNNING")
        ben.press_p()
        until(lambda: "ben is viewer, and SetPreviewMode needs operator" in ben.notes(), "what is missing")
        ben.video_moves()
        ben.link_is("connected")
        ben.preview_is("RUNNING")
        keep_screenshot(ben.window, "viewer-only")


def test_a_revoked_login_is_reported_without_hammering_and_a_new_one_taken_over(robot: Guarded) -> None:
    robot.log_in("carla", Role.OPERATOR)
    with in_front_of(robot) as carla:
        robot.admin.revoke("carla")
        carla.link_is("not allowed")
        banner = carla.window.banner
        assert banner.isVisible()
        assert "was revoked. Ask this robot's administrator" in banner.text.text()
        assert "robotctl login" in banner.text.text()
        assert not carla.window.preview.switch.isEnabled()
        let_pass(WATCHED_S)
        next_try = re.search(r"No access for .* Attempt (\d+) ", banner.next_try.text())
        assert next_try
        assert 1 < int(next_try[1]) <= MOST_ATTEMPTS + 1
        keep_screenshot(carla.window, "not-allowed")

        robot.log_in("carla", Role.OPERATOR)
        carla.link_is("connected")
        assert not banner.isVisible()
        carla.press_p()
        until(lambda: carla.notes().strip(), "the robot answers a request again")
        robot.switch_off()
        carla.preview_is("DISABLED")
        until(lambda: "the-test" in carla.events(), "events go on")


@pytest.mark.timed
def test_a_revoked_login_is_shown_within_two_seconds(robot: Guarded) -> None:
    def shown_after_s() -> float:
        robot.log_in("fritz", Role.VIEWER)
        with in_front_of(robot) as fritz:
            robot.admin.revoke("fritz")
            revoked_s = time.monotonic()
            fritz.link_is("not allowed")
            return time.monotonic() - revoked_s

    keeps(REVOKED_SHOWN_WITHIN_S, "s until a revoked login is shown", shown_after_s)


def test_a_wrong_token_does_not_lock_out_the_right_one(robot: Guarded) -> None:
    robot.log_in("dora", Role.VIEWER)
    kept = next(robot.home.rglob("token-*"))
    right = kept.read_text()
    kept.write_text(right[:-2] + ("AA" if right[-2:] != "AA" else "BA"))
    with monitor(robot.target, robot.stored) as window:
        dora = Person(window)
        dora.link_is("not allowed")
        let_pass(WATCHED_S)
        kept.write_text(right)
        dora.link_is("connected")
    assert "is locked out" not in robot.log()


def test_another_certificate_is_taken_over_like_another_token(tmp_path: Path) -> None:
    (tmp_path / "robot").mkdir()
    (tmp_path / "laptop").mkdir()
    with guarded_program(tmp_path / "robot", tmp_path / "laptop", Kind.CERTIFICATE) as robot:
        robot.log_in("emma", Role.OPERATOR)
        with in_front_of(robot) as emma:
            robot.admin.revoke("emma")
            emma.link_is("not allowed")
            assert "the certificate of emma" in emma.window.banner.text.text()
            robot.log_in("emma", Role.OPERATOR)
            emma.link_is("connected")
