"""Faults and events of the configuration's numbers."""

from typing import TYPE_CHECKING

from gateway.status.board import Board
from gateway.status.event import Event
from gateway.status.fault import Severity
from gateway.status.faults.tracker import FaultTracker
from gateway.status.limit import Limit
from gateway.status.meaning import ANY_NUMBER, NumberMeaning
from gateway.status.snapshot import SourceRule
from gateway.status.sources import number_source
from gateway.status.values import Number, Received
from tests.support.fault_rules import new_observer
from tests.support.status import snapshot_of

if TYPE_CHECKING:
    from gateway.observer import Observer

MOTOR = number_source(
    "motor",
    "Motor temperature",
    NumberMeaning("°C", warning_above=Limit(80, 75), error_above=Limit(95, 90), remedy="Let it cool down"),
)
CLEAR_AFTER_S = 2.0


class Robot:
    """Observes one number; time goes on by a second with each value."""

    def __init__(self, *, required: bool = False) -> None:
        self.tracker = FaultTracker(CLEAR_AFTER_S, 60.0)
        self.observer: Observer = new_observer(tracker=self.tracker)
        self.board, self.now_s = Board(), 100.0
        self.rules = {MOTOR: SourceRule(1500, required)}

    def reads(self, value: float | None) -> list[Event]:
        self.board[MOTOR] = Received(Number(value), self.now_s + 1)
        return self.waits()

    def waits(self, seconds: float = 1.0) -> list[Event]:
        self.now_s += seconds
        seen = snapshot_of(self.board, self.rules, now_s=self.now_s, faults=self.tracker.faults)
        return self.observer.observe(seen)

    def active(self) -> dict[str, Severity]:
        return {
            each.condition.fault_id: each.condition.severity for each in self.tracker.faults if each.active
        }


def test_what_was_cured_before_the_silence_stays_cured() -> None:
    """The defect: a fault that waited to be cleared when the topic fell silent stayed for ever."""
    robot = Robot()
    robot.reads(96.0)
    robot.reads(60.0)
    assert robot.active() == {"number.motor.high": Severity.ERROR}, "it is not cleared yet"
    robot.waits(3.0)
    assert robot.active() == {"number.motor.stale": Severity.WARNING}


def test_what_was_cured_before_the_number_was_unknown_stays_cured() -> None:
    robot = Robot()
    robot.reads(96.0)
    robot.reads(60.0)
    for _ in range(3):
        robot.reads(None)
    assert robot.active() == {"number.motor.no_value": Severity.WARNING}


def test_what_was_less_severe_before_the_number_was_unknown_becomes_less_severe() -> None:
    robot = Robot()
    robot.reads(96.0)
    robot.reads(85.0)
    for _ in range(3):
        robot.reads(None)
    assert set(robot.active().items()) >= {("number.motor.high", Severity.WARNING)}


def sentences(events: list[Event]) -> list[str]:
    return [event.sentence or event.message for event in events]


def test_crossing_each_limit_is_an_event() -> None:
    robot = Robot()
    assert robot.reads(60.0) == []
    assert sentences(robot.reads(80.0)) == ["warning: Motor temperature is high: 80 °C or more"]
    assert robot.reads(85.0) == []
    assert sentences(robot.reads(95.0)) == ["error now: Motor temperature is too high: 95 °C or more"]
    assert robot.active() == {"number.motor.high": Severity.ERROR}
    (fault,) = robot.tracker.faults
    assert (fault.condition.component, fault.condition.remedy) == ("Motor temperature", "Let it cool down")
    for _ in range(3):
        robot.reads(60.0)
    assert robot.active() == {}


def test_a_value_on_the_edge_is_one_event() -> None:
    robot = Robot()
    events = [event for step in range(50) for event in robot.reads(80.0 if step % 2 else 79.0)]
    assert len(events) == 1


def test_a_value_that_swings_across_both_limits_is_two_events() -> None:
    """Warning, error, and nothing more: less severe and good have to last."""
    robot = Robot()
    events = [event for step in range(50) for event in robot.reads((85.0, 99.0)[step % 2])]
    assert sentences(events) == [
        "warning: Motor temperature is high: 80 °C or more",
        "error now: Motor temperature is too high: 95 °C or more",
    ]


def test_less_severe_for_long_enough_is_less_severe() -> None:
    robot = Robot()
    robot.reads(99.0)
    robot.reads(85.0)
    assert robot.active() == {"number.motor.high": Severity.ERROR}
    robot.reads(85.0)
    assert robot.active() == {"number.motor.high": Severity.WARNING}


def test_silence_keeps_a_broken_limit_and_is_a_fault_of_its_own() -> None:
    robot = Robot()
    robot.reads(99.0)
    for _ in range(10):
        robot.waits()
    assert robot.active() == {"number.motor.high": Severity.ERROR, "number.motor.stale": Severity.WARNING}


def test_no_number_is_a_fault_and_keeps_a_broken_limit() -> None:
    robot = Robot()
    robot.reads(99.0)
    robot.reads(None)
    assert robot.active() == {"number.motor.high": Severity.ERROR, "number.motor.no_value": Severity.WARNING}
    required = Robot(required=True)
    required.reads(None)
    assert required.active() == {"number.motor.no_value": Severity.ERROR}


def test_the_same_configuration_is_the_same_source() -> None:
    assert number_source("a", "", ANY_NUMBER) is number_source("a", "", NumberMeaning())
    assert number_source("a", "", ANY_NUMBER) is not number_source("b", "", ANY_NUMBER)
    assert number_source("wheel_load", "", ANY_NUMBER).display_name == "wheel load"
