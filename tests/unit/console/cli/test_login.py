"""A new login: at a robot that has not read its list yet, and one that a pipe brings."""

import os
import socket
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

from common.errors import UserError
from common.reasons import Reason
from console.cli import piped_login
from console.cli.login import login, once_known
from console.client import NotAllowed

ISSUED = "# Robot Gateway login 1\nname: anna\nrole: viewer\ntoken: rgt-0123456789ab.x\nauthority:\nCA\n"
PATIENCE_S = 60.0
CONTEXT: Any = None
"""Of no command line: no option was given to it."""


class _Robot:
    """Refuses so many times."""

    def __init__(self, refusals: int, reason: Reason = Reason.CREDENTIAL_UNKNOWN) -> None:
        self.left, self.reason = refusals, reason
        self.slept_s = 0.0
        self.asked = 0

    def ask(self) -> str:
        self.asked += 1
        if self.left:
            self.left -= 1
            error = NotAllowed("the token is not one of this robot's")
            error.reason = self.reason
            raise error
        return "lab-1"

    def sleep(self, seconds: float) -> None:
        self.slept_s += seconds


def test_a_login_that_is_not_known_yet_is_shown_again() -> None:
    robot = _Robot(refusals=3)
    assert once_known(robot.ask, robot.sleep) == "lab-1"


def test_for_two_seconds_and_less_often_than_locks_the_address_out() -> None:
    robot = _Robot(refusals=99)
    with pytest.raises(NotAllowed):
        once_known(robot.ask, robot.sleep)
    assert 1.5 <= robot.slept_s <= 2
    assert robot.asked <= 5, "failures without a wait (gateway/access/lockout.py)"


def test_another_refusal_is_final() -> None:
    robot = _Robot(refusals=1, reason=Reason.CREDENTIAL_REVOKED)
    with pytest.raises(NotAllowed):
        once_known(robot.ask, robot.sleep)
    assert robot.slept_s == 0


@pytest.fixture(params=["pipe", "socket"])
def brought(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """The other end of this standard input, for the one who issues a login."""
    if request.param == "pipe":
        ours, theirs = os.pipe()
    else:
        ours, theirs = (each.detach() for each in socket.socketpair())
    with ExitStack() as stack:
        monkeypatch.setattr(sys, "stdin", stack.enter_context(os.fdopen(ours, encoding="utf-8")))
        stack.callback(os.close, theirs)
        yield theirs


@contextmanager
def ending(descriptor: int) -> Iterator[None]:
    """Ends what this end brings: another one, of nothing, takes its place."""
    try:
        yield
    finally:
        nothing = os.open("/dev/null", os.O_RDONLY)
        os.dup2(nothing, descriptor)
        os.close(nothing)


@pytest.mark.parametrize(
    ("name", "target", "says"), [("lab 2", "a:1", "can't be a robot's name"), ("lab", "a:x", "a:x")]
)
def test_a_login_that_a_pipe_brings_in_vain_is_named(brought: int, name: str, target: str, says: str) -> None:
    with ending(brought):
        os.write(brought, ISSUED.encode())
    with pytest.raises(UserError, match=says) as caught:
        login(CONTEXT, name, target)
    assert "the login in the pipe is not stored, but stays valid" in caught.value.what
    assert "robot-gateway credentials revoke 0123456789ab; then repeat" in caught.value.remedy


def test_a_wrong_name_waits_for_the_end_of_a_pipe_for_a_time_only(
    brought: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(piped_login, "ENDS_WITHIN_S", 0.05)
    with ThreadPoolExecutor(1) as pool, ending(brought):
        error = pool.submit(login, CONTEXT, "lab 2", "a:1").exception(PATIENCE_S)
    assert isinstance(error, UserError)
    assert "can't be a robot's name; what the pipe still brings is not stored" in error.what
    assert "robot-gateway credentials list" in error.remedy


def test_a_pipe_that_brings_no_login_has_lost_none(brought: int) -> None:
    """As where the robot's own command has failed."""
    with ending(brought):
        os.write(brought, b"no such user\n")
    with pytest.raises(UserError) as caught:
        login(CONTEXT, "lab 2", "a:1")
    assert caught.value.what == "'lab 2' can't be a robot's name"


def test_a_login_in_a_file_is_still_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As with `robotctl login lab HOST:PORT < file`."""
    file = tmp_path / "anna.login"
    file.write_text(ISSUED, encoding="utf-8")
    with file.open(encoding="utf-8") as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        with pytest.raises(UserError, match="a:x") as caught:
            login(CONTEXT, "lab", "a:x")
    assert "revoke" not in str(caught.value)
