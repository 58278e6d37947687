"""robotctl at a robot that asks who calls: logging in, roles, and a login that has ended."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from gateway.access.role import Role
from tests.support.guarded_program import ROBOT, Guarded, guarded_program
from tests.support.robotctl import ENDS_WITHIN_S, only_line, robotctl, robotctl_process
from tests.support.robotctl_docs import documented, holds
from tests.support.terminal import robotctl_on_terminal


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Guarded]:
    with guarded_program(tmp_path_factory.mktemp("robot"), tmp_path_factory.mktemp("laptop")) as robot:
        yield robot


def test_the_json_of_a_login_has_exactly_the_documented_keys(robot: Guarded) -> None:
    said = robot.log_in("anna", Role.OPERATOR)
    holds(documented("login --json"), said, complete=True)
    assert said == {
        "robot": ROBOT,
        "target": robot.target,
        "who": "anna, operator",
        "gateway_name": "lab-1",
    }


def test_the_json_of_a_login_that_was_not_tried_has_them_too(robot: Guarded, tmp_path: Path) -> None:
    robot.log_in("anna", Role.OPERATOR)
    login = robot.home / "anna.login"
    done = robotctl("login", "far", "far:1", str(login), "--offline", "--json", XDG_CONFIG_HOME=str(tmp_path))
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    holds(documented("login --json"), said, complete=True)
    assert said["gateway_name"] == ""


def test_a_viewers_key_is_refused_in_place_and_the_table_goes_on(robot: Guarded) -> None:
    robot.log_in("ben", Role.VIEWER)
    with robotctl_on_terminal(
        *("watch", "--interval", "0.2", "--robot", ROBOT),
        columns=200,
        extra={"XDG_CONFIG_HOME": str(robot.home)},
    ) as screen:
        screen.wait_to_see("q quit")
        screen.press("p")
        screen.wait_to_see("ben is viewer, and SetPreviewMode needs operator")
        refused = len(screen.read())
        screen.wait_for("lab-1", after=refused)
        shown = screen.lines()
        assert any("p preview on" in line for line in shown)
        assert not any("NO ANSWER" in line for line in shown)
        screen.press("q")
        assert screen.process.wait(ENDS_WITHIN_S) == 0
        assert screen.manners() == screen.manners_before


def test_a_login_that_is_revoked_ends_the_watching_with_one_line(robot: Guarded) -> None:
    robot.log_in("carl", Role.VIEWER)
    with robotctl_on_terminal(
        *("watch", "--robot", ROBOT), columns=200, extra={"XDG_CONFIG_HOME": str(robot.home)}
    ) as screen:
        screen.wait_to_see("q quit")
        robot.admin.revoke("carl")
        screen.wait_to_see("error: ")
        assert screen.process.wait(ENDS_WITHIN_S) == 1
        (said,) = [line for line in screen.lines() if line.startswith("error: ")]
        assert "no longer valid" in said
        assert re.search(rf"then type: robotctl login {ROBOT} [\w.]+:\d+ FILE --replace$", said)
        assert screen.manners() == screen.manners_before
    again = robot.robotctl("--robot", ROBOT, "status")
    assert again.returncode == 1
    assert "of carl" in only_line(again.stderr)
    assert "was revoked" in again.stderr


def test_a_token_is_never_sent_in_the_clear_and_no_window_opens_for_it(tmp_path: Path) -> None:
    book = tmp_path / "robotctl/config.toml"
    book.parent.mkdir()
    token = tmp_path / "token"
    token.write_text("x")
    token.chmod(0o600)
    book.write_text(f'[robots.far]\ntarget = "192.0.2.1:50051"\ntoken_file = "{token}"\n')
    for words in (("status",), ("monitor",)):
        done = robotctl_process(
            "--robot", "far", *words, XDG_CONFIG_HOME=str(tmp_path), QT_QPA_PLATFORM="offscreen"
        )
        assert done.returncode == 2, done
        assert "in the clear" in only_line(done.stderr)
