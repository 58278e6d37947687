"""Faults of the computer over time: what was cured, and then is stale or unknown."""

from dataclasses import replace

import pytest

from gateway.status.board import Board
from gateway.status.faults.tracker import FaultTracker
from gateway.status.sources import COMPUTE
from gateway.status.values import Compute, Received
from tests.support.fault_rules import new_observer
from tests.support.status import snapshot_of

COOL = Compute(10.0, 50.0, False, 1, 4, 50.0)
HOT = replace(COOL, cpu_temperature_c=90.0, thermal_throttled=True)
UNKNOWN = replace(COOL, cpu_temperature_c=None, thermal_throttled=None)
OF_HEAT = {"platform.temperature", "platform.throttled"}


class Computer:
    """Observes one computer; time goes on by a second with each look, and faults are cleared after two."""

    def __init__(self) -> None:
        self.tracker = FaultTracker(2.0, 60.0)
        self.observer = new_observer(tracker=self.tracker)
        self.board, self.now_s = Board(), 100.0

    def reads(self, compute: Compute) -> set[str]:
        self.board[COMPUTE] = Received(compute, self.now_s + 1)
        return self.waits()

    def waits(self, seconds: float = 1.0) -> set[str]:
        """Returns the active faults."""
        self.now_s += seconds
        self.observer.observe(snapshot_of(self.board, now_s=self.now_s, faults=self.tracker.faults))
        return {each.condition.fault_id for each in self.tracker.faults if each.active}


@pytest.mark.parametrize("stale", [True, False], ids=["stale", "unknown"])
def test_what_was_cured_before_it_was_unknown_stays_cured(stale: bool) -> None:
    """The defect: a fault that waited to be cleared meanwhile stayed for ever."""
    computer = Computer()
    assert computer.reads(HOT) == OF_HEAT
    assert computer.reads(COOL) == OF_HEAT, "they are not cleared yet"
    if stale:
        assert computer.waits(4.0) == {"platform.stale"}
    else:
        computer.reads(UNKNOWN)
        assert computer.reads(UNKNOWN) == set()


@pytest.mark.parametrize("stale", [True, False], ids=["stale", "unknown"])
def test_what_was_bad_before_it_was_unknown_stays_bad(stale: bool) -> None:
    computer = Computer()
    computer.reads(HOT)
    for _ in range(10):
        found = computer.waits() if stale else computer.reads(UNKNOWN)
    assert found == OF_HEAT | ({"platform.stale"} if stale else set())
