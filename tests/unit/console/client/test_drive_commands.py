"""Which commands hold, and until when each is valid, on a clock that the test moves."""

import random

import pytest

from console.client.drive_commands import HOLD_COUNTS_S, VALID_S, Commands, Hold
from console.client.robot_clock import RobotClock

STEP_S = 0.02
ROBOT_NS = 5_000_000_000
ARRIVED_S = 100.0


def robot_clock() -> RobotClock:
    clock = RobotClock()
    clock.note(ROBOT_NS, ARRIVED_S)
    return clock


class Driver:
    """A driver's hands, and the commands that leave at once unless they are `stuck`."""

    def __init__(self) -> None:
        self.commands = Commands("program")
        self.now_s = ARRIVED_S
        self.robot_clock = robot_clock()
        self.stuck = False

    def hold(self, vx_mps: float = 0.2, *, after_s: float = 0.0) -> None:
        self.now_s += after_s
        self.commands.hold(Hold(vx_mps, 0.0, 0.0, "gamepad", self.now_s))

    def next_holds(self, *, after_s: float = STEP_S) -> bool:
        self.now_s += after_s
        command = self.commands.make(self.now_s, self.robot_clock, 0)
        if not self.stuck:
            self.commands.left(command.sequence, held=command.held)
        return command.held


@pytest.fixture
def driver() -> Driver:
    return Driver()


def test_a_command_is_valid_for_250_ms_on_the_robots_clock() -> None:
    late = Commands("program").make(ARRIVED_S + 0.125, robot_clock(), 7)
    assert late.echo_monotonic_ns == ROBOT_NS
    assert late.valid_until_monotonic_ns == ROBOT_NS + int((0.125 + VALID_S) * 1e9)
    assert late.picture_monotonic_ns == 7


def test_the_device_is_the_holds_own_and_that_of_the_session_without_one(driver: Driver) -> None:
    assert driver.commands.make(driver.now_s, driver.robot_clock, 0).input_device == "program"
    driver.hold()
    assert driver.commands.make(driver.now_s, driver.robot_clock, 0).input_device == "gamepad"


def test_a_hold_counts_for_100_ms(driver: Driver) -> None:
    driver.hold()
    assert driver.next_holds(after_s=HOLD_COUNTS_S - 0.001)
    assert not driver.next_holds(after_s=0.002)


def test_after_a_hold_that_was_renewed_too_late_none_counts_until_a_release(driver: Driver) -> None:
    driver.hold()
    assert driver.next_holds()
    driver.hold(after_s=HOLD_COUNTS_S)
    assert driver.commands.lapsed
    assert not driver.next_holds()
    driver.hold()
    assert not driver.next_holds()
    driver.commands.release()
    assert not driver.next_holds()
    driver.hold()
    assert driver.next_holds()


def test_a_release_that_is_followed_by_a_hold_at_once_is_sent(driver: Driver) -> None:
    driver.hold()
    assert driver.next_holds()
    driver.commands.release()
    driver.hold(-0.2)
    assert not driver.next_holds()
    assert driver.next_holds()


def test_no_hold_begins_before_the_release_has_left(driver: Driver) -> None:
    driver.hold()
    assert driver.next_holds()
    driver.stuck = True
    driver.commands.release()
    for _ in range(3):
        assert not driver.next_holds()
        driver.hold()
    driver.stuck = False
    assert not driver.next_holds()
    driver.hold()
    assert driver.next_holds()


def test_a_command_that_leaves_late_is_no_release_of_a_later_hold(driver: Driver) -> None:
    """One lane may be slower than the others, by as much as the network holds it up."""
    late = driver.commands.make(driver.now_s, driver.robot_clock, 0)
    driver.hold()
    assert driver.next_holds()
    driver.stuck = True
    driver.commands.release()
    assert not driver.next_holds()
    driver.commands.left(late.sequence, held=late.held)
    driver.hold()
    assert not driver.next_holds(), "the release has not left"


def test_no_hold_counts_once_the_session_ends(driver: Driver) -> None:
    """A window's thread holds on until it knows; the last command of all has to be a release."""
    driver.hold()
    assert driver.next_holds()
    driver.commands.end()
    driver.hold()
    assert not driver.next_holds()
    driver.commands.release()
    driver.hold()
    assert not driver.next_holds()
    assert not driver.next_holds()


@pytest.mark.parametrize("number", [float("nan"), float("inf"), float("-inf")])
def test_what_is_no_velocity_is_refused_and_the_hold_before_it_stays(driver: Driver, number: float) -> None:
    driver.hold()
    with pytest.raises(ValueError, match="finite"):
        driver.hold(number)
    command = driver.commands.make(driver.now_s, driver.robot_clock, 0)
    assert command.held
    assert command.vx_mps == 0.2


def test_a_release_without_a_hold_says_so(driver: Driver) -> None:
    assert not driver.commands.release()
    driver.hold()
    assert driver.commands.release()
    assert not driver.commands.release()


@pytest.mark.parametrize("seed", range(20))
def test_whatever_the_hands_do_a_command_that_is_no_hold_leaves_between_two_holds(seed: int) -> None:
    """What leaves is all that the robot sees: a release that no command shows has not happened there."""
    chance = random.Random(seed)
    driver = Driver()
    robot_sees_hold = released = False
    begun = 0
    for _ in range(500):
        for act in chance.choices(
            ["hold", "release", "hesitate", "stick"], [6, 2, 1, 1], k=chance.randrange(4)
        ):
            if act == "hold":
                driver.hold()
            elif act == "release":
                released |= driver.commands.release()
            elif act == "hesitate":
                driver.now_s += 2 * HOLD_COUNTS_S
            else:
                driver.stuck = not driver.stuck
        holds = driver.next_holds()
        if driver.stuck:
            continue
        assert not (holds and robot_sees_hold and released), "the release was lost"
        begun += holds and not robot_sees_hold
        robot_sees_hold = holds
        released = False
    assert begun > 10
