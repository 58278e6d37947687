"""`robotctl view` at a robot that asks who calls: by the robot's name, with an encrypted stream."""

import json
import time
from collections.abc import Iterator

import pytest

from console.client import GatewayClient
from console.viewer.formatting import banner
from console.viewer.playback import PlaybackState
from console.viewer.summary import FrameCounter
from gateway.access.role import Role
from tests.support.guarded_program import ROBOT, Guarded, guarded_video
from tests.support.promise import keeps
from tests.support.qt import application, press, until
from tests.support.robotctl import only_line, robotctl_process
from tests.support.robotctl_docs import documented, holds
from tests.support.waiting import wait_until

from PySide6.QtCore import Qt  # isort: skip - after Qt's platform was chosen

from console.window.programs import viewing

pytestmark = [pytest.mark.gst, pytest.mark.timed, pytest.mark.usefixtures("application")]
__all__ = ["application"]

REVOKED_SHOWN_WITHIN_S = 2.0
SHOWN_WITHIN_S = 10.0
"""For what no time is promised of."""


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Guarded]:
    """The preview is off at first."""
    with guarded_video(tmp_path_factory.mktemp("robot"), tmp_path_factory.mktemp("laptop")) as robot:
        yield robot


def view(robot: Guarded, *words: str) -> tuple[int, str, str]:
    done = robot.robotctl_process("--robot", ROBOT, "view", "--headless", "--frames", "30", *words)
    return done.returncode, done.stdout, done.stderr


def test_a_viewer_by_the_robots_name_sees_an_encrypted_stream(robot: Guarded) -> None:
    robot.switch_on()
    robot.log_in("ben", Role.VIEWER)
    status = json.loads(robot.robotctl("--robot", ROBOT, "--json", "status").stdout)
    assert status["preview"]["endpoint"]["encrypted"]
    code, said, complaints = view(robot, "--json")
    assert (code, complaints) == (0, "")
    document = json.loads(said)
    holds(documented("view --json"), document, complete=False)
    assert document["pictures"] >= 30
    assert document["recording"] is None


def test_without_a_valid_login_there_is_no_video(robot: Guarded) -> None:
    robot.switch_on()
    robot.log_in("carl", Role.VIEWER)
    robot.admin.revoke("carl")
    wait_until(lambda: view(robot)[0] == 1, "carl is refused", SHOWN_WITHIN_S)
    code, said, complaints = view(robot)
    assert (code, said) == (1, "")
    assert "was revoked" in only_line(complaints)
    assert complaints.endswith(f"then type: robotctl login {ROBOT} {robot.target} FILE --replace\n")
    stranger = robotctl_process("--target", robot.target, "view", "--headless", "--frames", "1")
    assert (stranger.returncode, stranger.stdout) == (3, "")
    assert "robotctl login" in only_line(stranger.stderr)


def test_the_window_names_the_missing_role_and_takes_a_new_login_over(robot: Guarded) -> None:
    robot.switch_off()
    robot.log_in("dora", Role.VIEWER)
    with viewing(robot.target, None, FrameCounter(), robot.stored) as window:
        until(lambda: window.robot.session.playback().state is PlaybackState.OFF, "the preview is off")
        press(window, Qt.Key.Key_P)
        until(
            lambda: "dora is viewer, and SetPreviewMode needs operator" in window.notes.text(),
            "what is missing",
        )
        robot.admin.revoke("dora")
        until(
            lambda: window.robot.session.playback().state is PlaybackState.NO_ACCESS,
            "no access",
            SHOWN_WITHIN_S,
        )
        card = banner(window.robot.session.playback())
        assert card
        assert "was revoked. Ask this robot's administrator for a new login" in card.detail
        assert "then type: robotctl login NAME HOST:PORT FILE --replace" in card.detail
        robot.log_in("dora", Role.OPERATOR)
        until(
            lambda: window.robot.session.playback().state is PlaybackState.OFF,
            "the new login counts",
            SHOWN_WITHIN_S,
        )
        press(window, Qt.Key.Key_P)
        until(lambda: window.robot.session.playback().state is PlaybackState.LIVE, "video")
        robot.admin.revoke("dora")
        # The video ends, too: the stream has another passphrase from then on, which she does not get.
        until(
            lambda: window.robot.session.playback().state is PlaybackState.NO_ACCESS,
            "no access",
            SHOWN_WITHIN_S,
        )


def test_a_revoked_login_is_shown_within_two_seconds(robot: Guarded) -> None:
    robot.switch_off()

    def shown_after_s() -> float:
        robot.log_in("gina", Role.VIEWER)
        with viewing(robot.target, None, FrameCounter(), robot.stored) as window:
            session = window.robot.session
            until(lambda: session.playback().state is PlaybackState.OFF, "the preview is off")
            robot.admin.revoke("gina")
            revoked_s = time.monotonic()
            until(lambda: session.playback().state is PlaybackState.NO_ACCESS, "no access")
            return time.monotonic() - revoked_s

    keeps(REVOKED_SHOWN_WITHIN_S, "s until a revoked login is shown", shown_after_s)


def test_after_a_revocation_the_other_viewers_reconnect_by_themselves(robot: Guarded) -> None:
    robot.log_in("emil", Role.VIEWER)
    emils = robot.stored()
    robot.log_in("frida", Role.VIEWER)
    robot.switch_on()
    with GatewayClient(robot.target, credentials=emils) as client:
        known = client.status().preview.endpoint
    assert known
    with viewing(robot.target, None, FrameCounter(), robot.stored) as window:
        until(lambda: window.robot.session.playback().state is PlaybackState.LIVE, "video")
        robot.admin.revoke("emil")
        with robot.client() as client:
            wait_until(
                lambda: (
                    (endpoint := client.status().preview.endpoint) is not None
                    and endpoint.passphrase not in {"", known.passphrase}
                ),
                "another passphrase",
                SHOWN_WITHIN_S,
            )
        # The old stream ended with its passphrase; no redial where the status named the new one first.
        session = window.robot.session
        before = session.frames
        until(
            lambda: session.playback().state is PlaybackState.LIVE and session.frames > before + 30,
            "her video is back",
            SHOWN_WITHIN_S,
        )
