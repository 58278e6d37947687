"""Faults and events of the configuration's texts."""

from gateway.status.board import Board
from gateway.status.fault import Severity
from gateway.status.faults.tracker import FaultTracker
from gateway.status.meaning import TextMeaning
from gateway.status.snapshot import SourceRule
from gateway.status.sources import text_source
from gateway.status.values import Received, Text
from tests.support.fault_rules import new_observer
from tests.support.status import snapshot_of

LEVELS = (("open", None), ("slipping", Severity.WARNING), ("jammed!", Severity.ERROR))


class Robot:
    """Observes one text; time goes on by three seconds with each, so that what is gone is cleared."""

    def __init__(self, other: Severity | None = None) -> None:
        self.source = text_source("gripper", "Gripper", TextMeaning(LEVELS, other))
        self.tracker = FaultTracker(2.0, 60.0)
        self.observer = new_observer(tracker=self.tracker)
        self.board, self.now_s = Board(), 100.0

    def says(self, text: str | None) -> dict[str, Severity]:
        """Returns the active faults."""
        self.board[self.source] = Received(Text(text), self.now_s + 3)
        return self.waits()

    def waits(self) -> dict[str, Severity]:
        self.now_s += 3
        rules = {self.source: SourceRule(1000, required=False)}
        self.observer.observe(snapshot_of(self.board, rules, now_s=self.now_s, faults=self.tracker.faults))
        return {
            each.condition.fault_id: each.condition.severity for each in self.tracker.faults if each.active
        }


def test_listed_texts_have_their_own_faults() -> None:
    robot = Robot()
    assert robot.says("open") == {}
    assert robot.says("slipping") == {"text.gripper.value.slipping": Severity.WARNING}
    assert robot.says("jammed!") == {"text.gripper.value.jammed": Severity.ERROR}
    assert robot.tracker.faults[0].condition.message == "Gripper: jammed!"
    assert robot.says("something else") == {}


def test_other_texts_share_one_fault() -> None:
    robot = Robot(Severity.ERROR)
    assert robot.says("open") == {}
    for text in ("one", "two", ""):
        assert robot.says(text) == {"text.gripper.value.other": Severity.ERROR}
    (fault,) = robot.tracker.faults
    assert (fault.times_raised, fault.condition.message) == (1, "Gripper: an empty text")


def test_what_was_cured_before_the_silence_stays_cured() -> None:
    """The defect: a fault that waited to be cleared when the topic fell silent stayed for ever."""
    robot = Robot()
    robot.says("jammed!")
    robot.now_s -= 2.5  # Half a second later.
    assert set(robot.says("open")) == {"text.gripper.value.jammed"}, "it is not cleared yet"
    assert set(robot.waits()) == {"text.gripper.stale"}


def test_what_was_cured_before_the_text_was_unknown_stays_cured() -> None:
    robot = Robot()
    robot.says("jammed!")
    robot.now_s -= 2.5
    assert set(robot.says("open")) == {"text.gripper.value.jammed"}, "it is not cleared yet"
    assert set(robot.says(None)) == {"text.gripper.no_value"}


def test_silence_and_no_text_keep_what_was_bad() -> None:
    robot = Robot()
    robot.says("jammed!")
    assert set(robot.waits()) == {"text.gripper.value.jammed", "text.gripper.stale"}
    assert set(robot.says(None)) == {"text.gripper.value.jammed", "text.gripper.no_value"}
    assert robot.says("open") == {}
