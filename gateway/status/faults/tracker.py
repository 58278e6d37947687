"""The fault tracker: raises a fault when a condition appears, clears it when the condition stays absent."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final

from gateway.status.fault import Condition, Fault, Severity

MOST_ACTIVE: Final = 32
"""Further active faults are counted, not listed: a robot full of faults must not flood its link."""
MOST_CLEARED: Final = 8
"""Cleared faults that are kept."""
CAPPED: Final = "faults.capped"
_MOST_COUNTED: Final = 1024
"""Fault ids whose count is kept; bounded, because the robot's components choose the ids of diagnostics."""


@dataclass(frozen=True, slots=True)
class Changes:
    """The difference that one update made."""

    raised: tuple[Fault, ...]
    worsened: tuple[Fault, ...]
    """Active before, now more severe."""
    cleared: tuple[Fault, ...]


class FaultTracker:
    """Belongs to one event loop; `faults` may be read at any time.

    Args:
        clear_after_s: how long a condition must be absent before its fault is cleared, and how long it must
            be less severe before its fault is. What comes and goes faster is one fault, not a series.
        keep_cleared_s: how long a cleared fault is kept.
    """

    def __init__(self, clear_after_s: float, keep_cleared_s: float) -> None:
        self._clear_after_s = clear_after_s
        self._keep_cleared_s = keep_cleared_s
        self._active: dict[str, Fault] = {}
        self._cleared: dict[str, Fault] = {}
        self._times: dict[str, int] = {}
        self._severe_s: dict[str, float] = {}
        """When each active fault was last observed with its present severity."""
        self.faults: tuple[Fault, ...] = ()
        """Active faults by severity, then age; after them the cleared ones, the newest first."""

    @property
    def active_ids(self) -> frozenset[str]:
        """Ids of the active faults, which rules with hysteresis need."""
        return frozenset(self._active)

    def update(self, conditions: Iterable[Condition], now_s: float) -> Changes:
        """Tracks the conditions that are present at `now_s`; returns the difference."""
        present = {condition.fault_id: condition for condition in conditions}
        held = {fault_id: self._held(condition, now_s) for fault_id, condition in present.items()}
        candidates = {**self._lingering(now_s), **held}
        listed = self._listed(candidates)
        raised, worsened = [], []
        for fault_id in listed.keys() & (present.keys() | {CAPPED}):
            condition, before = listed[fault_id], self._active.get(fault_id)
            if before is None:
                raised.append(self._raise(condition, now_s))
                continue
            seen = present.get(fault_id, condition).severity
            fault = replace(before, condition=condition, seen_s=now_s, seen_severity=seen)
            self._active[fault_id] = fault
            if condition.severity.rank > before.condition.severity.rank:
                worsened.append(fault)
        gone = [self._active.pop(fault_id) for fault_id in self._active.keys() - listed.keys()]
        for fault_id in self._active.keys() - present.keys() - {CAPPED}:
            self._active[fault_id] = replace(self._active[fault_id], seen_severity=None)
        self._severe_s = {fault_id: self._severe_s.get(fault_id, now_s) for fault_id in self._active}
        # A fault that lost its place in the list to a more severe one is still present.
        absent = [fault for fault in gone if fault.condition.fault_id not in candidates]
        cleared = [replace(fault, cleared_s=now_s, seen_severity=None) for fault in absent]
        self._cleared |= {fault.condition.fault_id: fault for fault in cleared}
        self._forget(now_s)
        self.faults = (*_by_weight(self._active.values()), *reversed(self._cleared.values()))
        return Changes(_by_weight(raised), _by_weight(worsened), _by_weight(cleared))

    def _held(self, condition: Condition, now_s: float) -> Condition:
        """Returns the condition; the more severe one that its fault has, until `clear_after_s` after that.

        Otherwise a value that swings over a limit would report "worse" at every swing.
        """
        fault_id, before = condition.fault_id, self._active.get(condition.fault_id)
        if (
            before is not None
            and condition.severity.rank < before.condition.severity.rank
            and now_s - self._severe_s[fault_id] < self._clear_after_s
        ):
            return before.condition
        self._severe_s[fault_id] = now_s
        return condition

    def _lingering(self, now_s: float) -> dict[str, Condition]:
        """Returns the conditions that were present less than `clear_after_s` ago."""
        return {
            fault_id: fault.condition
            for fault_id, fault in self._active.items()
            if fault_id != CAPPED and now_s - fault.seen_s < self._clear_after_s
        }

    def _listed(self, conditions: dict[str, Condition]) -> dict[str, Condition]:
        """Returns the MOST_ACTIVE most severe ones; among equals, those that are listed already stay."""
        if len(conditions) <= MOST_ACTIVE:
            return conditions
        ordered = sorted(
            conditions.values(),
            key=lambda each: (-each.severity.rank, each.fault_id not in self._active, each.fault_id),
        )
        kept = {condition.fault_id: condition for condition in ordered[: MOST_ACTIVE - 1]}
        return kept | {CAPPED: _capped(len(conditions) - len(kept))}

    def _raise(self, condition: Condition, now_s: float) -> Fault:
        fault_id = condition.fault_id
        times = self._times.pop(fault_id, 0) + 1
        self._times[fault_id] = times
        if len(self._times) > _MOST_COUNTED:
            del self._times[next(iter(self._times))]
        self._cleared.pop(fault_id, None)
        fault = self._active[fault_id] = Fault(condition, now_s, now_s, None, times, condition.severity)
        return fault

    def _forget(self, now_s: float) -> None:
        newest = list(self._cleared.items())[-MOST_CLEARED:]
        self._cleared = {
            fault_id: fault
            for fault_id, fault in newest
            if fault.cleared_s is not None and now_s - fault.cleared_s <= self._keep_cleared_s
        }


def _by_weight(faults: Iterable[Fault]) -> tuple[Fault, ...]:
    return tuple(
        sorted(
            faults,
            key=lambda fault: (-fault.condition.severity.rank, fault.onset_s, fault.condition.fault_id),
        )
    )


def _capped(left_out: int) -> Condition:
    return Condition(
        CAPPED,
        Severity.WARNING,
        "gateway",
        f"{left_out} more faults are not listed",
        f"Repair the listed ones first; at most {MOST_ACTIVE} are listed at once",
    )
