"""Events of the robot's mode: each change at once, a flood of them as one in a while, with their number."""

import pytest

from gateway.status.event import ModeChanged
from gateway.status.mode_events import BURST, SPACING_S, ModeEvents

NOW_S = 1000.0


class Robot:
    """Looked at five times a second; its first mode is the baseline."""

    def __init__(self) -> None:
        self.events, self.now_s = ModeEvents(), NOW_S
        self.messages: list[str] = []
        self.modes: list[str] = []
        self.is_in("idle")
        self.messages.clear()
        self.modes.clear()

    def is_in(self, mode: str, seconds: float = 0.2) -> None:
        for _ in range(round(seconds / 0.2)):
            self.now_s += 0.2
            for event in self.events.take(mode, self.now_s):
                assert isinstance(event.detail, ModeChanged)
                assert event.sentence == event.message
                self.messages.append(event.message)
                self.modes.append(event.detail.mode)

    def alternates(self, seconds: float) -> None:
        """As where two programs publish the mode."""
        for _ in range(round(seconds / 0.4)):
            self.is_in("idle")
            self.is_in("exploring")


@pytest.fixture
def robot() -> Robot:
    return Robot()


def test_each_change_is_an_event_at_once(robot: Robot) -> None:
    for mode in ("exploring", "exploring", "idle", "charging"):
        robot.is_in(mode)
    assert robot.messages == ["robot mode: exploring", "robot mode: idle", "robot mode: charging"]


def test_a_mission_of_many_phases_loses_none(robot: Robot) -> None:
    for phase in range(100):
        robot.is_in(f"phase {phase}", SPACING_S)
    assert robot.modes == [f"phase {phase}" for phase in range(100)]


def test_a_mode_that_alternates_without_end_is_few_events(robot: Robot) -> None:
    """The defect: one event for each look, which pushed all others out of the log within minutes."""
    robot.alternates(3600)
    assert len(robot.messages) <= BURST + 3600 / SPACING_S + 1


def test_what_was_left_out_is_counted_and_the_last_mode_is_reported(robot: Robot) -> None:
    robot.alternates(120)
    robot.is_in("charging", SPACING_S)
    assert robot.modes[-1] == "charging"
    counts = [
        1 + int(message.rpartition(" after ")[2].split()[0]) if " after " in message else 1
        for message in robot.messages
    ]
    assert sum(counts) == 600, "599 alternations from the first idle on, and the last mode"
    robot.is_in("charging", 10 * SPACING_S)
    assert robot.modes.count("charging") == 1


def test_a_mode_that_is_the_last_reported_one_again_is_reported_with_what_was_between() -> None:
    robot = Robot()
    robot.alternates(120)
    robot.is_in(robot.modes[-1], 2 * SPACING_S)
    assert robot.modes[-1] == robot.modes[-2]
    assert " after " in robot.messages[-1]
