"""The practice robot decides as the drive program, and its base follows."""

from dataclasses import dataclass, field

import pytest

from drive.motion.machine import EndLease, GrantLease, Reset, Rules, Stop
from drive.motion.phases import Phase
from drive.motion.values import MS, Command, Inhibit, Lease, LeaseEnd, Velocity
from practice.robot import PracticeRobot

CYCLE_NS = 20 * MS
BEGIN_NS = 1_000_000 * MS


@dataclass
class Driver:
    """Drives by a fresh picture unless a test changes that."""

    robot: PracticeRobot = field(default_factory=lambda: PracticeRobot(BEGIN_NS))
    now_ns: int = BEGIN_NS
    sequence: int = 0
    camera: bool = True
    picture_ns: int = 0

    def opens(self) -> None:
        self.robot.feed(GrantLease(Lease("one", "anna")), self.now_ns)

    def drives(self, seconds: float, *, held: bool = True, commands: bool = True) -> None:
        for _ in range(round(seconds * 1e9) // CYCLE_NS):
            self.now_ns += CYCLE_NS
            if self.camera:
                self.robot.captured_ns = self.picture_ns = self.now_ns
            if commands:
                self.sequence += 1
                self.robot.feed(self.command(held=held), self.now_ns)
            self.robot.advance(self.now_ns)

    def command(self, *, held: bool) -> Command:
        return Command(
            "one", self.sequence, held, Velocity(0.2), self.now_ns + 250 * MS, self.now_ns, self.picture_ns
        )

    @property
    def phase(self) -> Phase:
        return self.robot.state.phase

    @property
    def speed(self) -> float:
        return self.robot.velocity(self.now_ns).vx_mps


@pytest.fixture
def driver() -> Driver:
    driver = Driver()
    driver.opens()
    driver.drives(0.5, held=False)
    assert driver.phase is Phase.ARMED
    driver.drives(1.0)
    return driver


def test_it_is_driven_by_the_drive_programs_rules(driver: Driver) -> None:
    assert driver.robot.rules == Rules()
    assert driver.phase is Phase.DRIVING
    assert driver.speed == pytest.approx(0.2, abs=0.001)
    assert 0.1 < driver.robot.pose.x_m < 0.2


def test_a_release_stops_it_at_once(driver: Driver) -> None:
    driver.robot.feed(driver.command(held=False), driver.now_ns)
    driver.sequence += 1
    driver.robot.feed(driver.command(held=False), driver.now_ns)
    assert driver.speed == 0


def test_a_stop_lasts_until_its_reset(driver: Driver) -> None:
    driver.robot.feed(Stop("a viewer"), driver.now_ns)
    assert driver.speed == 0
    driver.drives(1.0)
    assert driver.robot.state.latch is not None
    driver.drives(0.1, held=False)
    driver.robot.feed(Reset(1), driver.now_ns)
    driver.drives(0.2, held=False)
    assert driver.phase is Phase.ARMED


def test_a_silent_camera_stops_it_600_ms_after_the_last_picture(driver: Driver) -> None:
    driver.camera = False
    driver.drives(0.58)
    assert driver.speed > 0
    driver.drives(0.06)
    assert driver.speed == 0
    assert driver.robot.state.inhibits == {Inhibit.PICTURE_STALE}


def test_an_older_picture_slows_it_down(driver: Driver) -> None:
    driver.camera = False
    driver.drives(0.54)
    assert 0 < driver.speed <= 0.1 / 0.54 + 0.01
    assert driver.robot.speed_limit_mps(driver.now_ns) == pytest.approx(0.1 / 0.54)
    assert driver.robot.turn_limit_rad_s(driver.now_ns) == pytest.approx(0.35 / 0.54)


def test_without_commands_it_stops_and_after_2_s_it_has_lost_its_driver(driver: Driver) -> None:
    driver.drives(0.3, commands=False)
    assert driver.speed == 0
    assert driver.phase is Phase.INHIBITED
    driver.drives(1.8, commands=False)
    assert driver.robot.state.lease is None


def test_the_picture_off_is_a_reason_not_to_move(driver: Driver) -> None:
    driver.robot.preview_on = False
    driver.drives(0.04)
    assert driver.robot.state.inhibits == {Inhibit.PICTURE_MISSING}


def test_without_a_driver_nothing_limits_and_nothing_moves(driver: Driver) -> None:
    driver.robot.feed(EndLease("one", LeaseEnd.CLOSED), driver.now_ns)
    driver.drives(1.0)
    assert driver.robot.speed_limit_mps(driver.now_ns) == 0
    assert driver.robot.turn_limit_rad_s(driver.now_ns) == 0
    assert driver.speed == 0
    assert driver.phase is Phase.AVAILABLE
