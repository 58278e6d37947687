"""A new login at a robot that has not read its list yet."""

import pytest

from common.reasons import Reason
from console.cli.login import once_known
from console.client import NotAllowed


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
