"""Random lives of a robot against the plainest model of what a client must then see.

Messages come late, in bursts, or not at all; the system clock is set by years; time passes in jumps. The
model remembers the true moment of each newest message and nothing else.
"""

from dataclasses import dataclass, field
from typing import Any

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from common.receive_time import Instant, received_at
from gateway.status.board import Board
from gateway.status.fault import Severity
from gateway.status.faults.tracker import FaultTracker
from gateway.status.snapshot import Snapshot, SourceRule
from gateway.status.source_view import SourceState
from gateway.status.sources import BATTERY, ODOMETRY, VISION, SourceSpec
from gateway.status.values import Battery, Received, Velocity, Vision
from tests.support.fault_rules import new_observer
from tests.support.status import snapshot_of

GRACE_S, CLEAR_AFTER_S, PASS_S = 5.0, 2.0, 0.05
LIMITS_MS: dict[SourceSpec[Any], int] = {ODOMETRY: 1000, VISION: 2000, BATTERY: 5000}
RULES = {spec: SourceRule(limit, spec is not BATTERY) for spec, limit in LIMITS_MS.items()}
WORDS: dict[SourceSpec[Any], str] = {ODOMETRY: "odometry", VISION: "vision telemetry"}
SPECS = st.sampled_from(sorted(LIMITS_MS, key=lambda spec: spec.name))


def value_of(spec: SourceSpec[Any], number: int) -> Velocity | Vision | Battery:
    if spec is ODOMETRY:
        return Velocity(float(number), 0.0, 0.0)
    if spec is VISION:
        return Vision(float(number), 0.0, 0.0, 0, 0)
    return Battery(True, float(number), 80.0, False)


@dataclass
class Model:
    """What is true."""

    numbers: dict[SourceSpec[Any], int] = field(default_factory=dict)
    """Of the newest message."""
    arrived_s: dict[SourceSpec[Any], float] = field(default_factory=dict)
    slack_s: dict[SourceSpec[Any], float] = field(default_factory=dict)
    """How wrong its age may be: nothing, or one sampling period when the system clock was set meanwhile."""

    def age_s(self, spec: SourceSpec[Any], now_s: float) -> float | None:
        return now_s - self.arrived_s[spec] if spec in self.arrived_s else None


class Life(RuleBasedStateMachine):
    """The pure core with a sampler in front of it, both driven by hand."""

    def __init__(self) -> None:
        super().__init__()
        self.now_s, self.wall_ns = 1000.0, 1_700_000_000_000_000_000
        self.board, self.model, self.sent = Board(), Model(), 0
        self.tracker = FaultTracker(CLEAR_AFTER_S, keep_cleared_s=1e9)
        self.observer = new_observer(startup_grace_s=GRACE_S, tracker=self.tracker)
        self.raised = self.cleared = 0
        self.look()

    @rule(spec=SPECS, waits=st.floats(0, PASS_S), jump_s=st.sampled_from([0, 0, 0, 0.02, -3600, 3600, 1e9]))
    def a_message_arrives_and_is_fetched(self, spec: SourceSpec[Any], waits: float, jump_s: float) -> None:
        """It waits for the next pass of the sampler; in between the system clock may be set."""
        self.one_message(spec, waits, jump_s)

    @rule(spec=SPECS, count=st.integers(2, 20))
    def a_burst_arrives_at_once(self, spec: SourceSpec[Any], count: int) -> None:
        """Late messages in one heap: the newest one counts, its age is since it came here."""
        self.sent += count - 1
        self.one_message(spec, 0.0, 0.0)

    @rule(seconds=st.floats(0.01, 20))
    def nothing_happens(self, seconds: float) -> None:
        self.pass_time(seconds)

    @rule(years=st.integers(-30, 30))
    def the_system_clock_is_set(self, years: int) -> None:
        self.wall_ns += years * 31_536_000 * 1_000_000_000

    def one_message(self, spec: SourceSpec[Any], waits: float, jump_s: float) -> None:
        emptied_at_s = self.now_s
        self.pass_time(PASS_S - waits)
        arrived_s, stamp_ns = self.now_s, self.wall_ns
        self.wall_ns += int(jump_s * 1e9)
        self.pass_time(waits)
        at_s = received_at(stamp_ns, Instant(self.now_s, self.wall_ns), emptied_at_s)
        self.sent += 1
        self.board[spec] = Received(value_of(spec, self.sent), at_s)
        self.model.numbers[spec] = self.sent
        self.model.arrived_s[spec] = arrived_s
        self.model.slack_s[spec] = PASS_S if jump_s else 0.0

    def pass_time(self, seconds: float) -> None:
        """Time passes; the gateway's own timer looks often enough meanwhile."""
        until_s = self.now_s + seconds
        while self.now_s < until_s:
            step_s = min(1.0, until_s - self.now_s)
            self.now_s += step_s
            self.wall_ns += int(step_s * 1e9)
            self.look()

    def look(self) -> Snapshot:
        now = self.snapshot()
        for event in self.observer.observe(now):
            said = event.sentence or ""
            self.raised += said.startswith(("error: ", "warning: "))
            self.cleared += said.startswith("cleared: ")
        return now

    def snapshot(self) -> Snapshot:
        return snapshot_of(self.board, RULES, now_s=self.now_s, faults=self.tracker.faults)

    @invariant()
    def every_value_is_the_newest_and_its_age_is_true(self) -> None:
        now = self.snapshot()
        for source in now.sources:
            spec, seen = source.spec, source.freshness
            age_s = self.model.age_s(spec, self.now_s)
            assert now[spec].freshness == seen
            if age_s is None:
                assert (seen.available, seen.stale, seen.age_ms) == (False, False, 0)
                assert now[spec].value is None
                assert source.state is SourceState.WAITING
                continue
            assert now[spec].value == value_of(spec, self.model.numbers[spec])
            assert abs(seen.age_ms - age_s * 1000) <= self.model.slack_s[spec] * 1000 + 1.01
            assert seen.stale == (seen.age_ms > LIMITS_MS[spec])
            assert source.state is (SourceState.STALE if seen.stale else SourceState.RECEIVING)

    @invariant()
    def health_names_the_first_thing_that_is_wrong(self) -> None:
        now = self.snapshot()
        expected = "robot healthy"
        required: tuple[SourceSpec[Any], ...] = (VISION, ODOMETRY)
        for spec in required:
            seen = now[spec].freshness
            if not seen.available:
                expected = f"waiting for {WORDS[spec]}"
            elif seen.stale:
                expected = f"{WORDS[spec]} stale"
        ready = expected == "robot healthy"
        active = [fault.condition for fault in now.faults if fault.active]
        errors = [each for each in active if each.severity is Severity.ERROR]
        if ready and errors:
            # A fault outlasts its condition for a moment; all of these sources are required.
            more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
            expected = f"{errors[0].message}{more}"
        assert (now.health.summary, now.health.ready) == (expected, ready)

    @invariant()
    def what_is_wrong_is_a_fault_and_what_is_well_is_none_for_long(self) -> None:
        now = self.look()
        active = {fault.condition.fault_id: fault for fault in self.tracker.faults if fault.active}
        for source in now.sources:
            if source.state is SourceState.STALE:
                assert f"{source.spec.name}.stale" in active
            if source.state is SourceState.WAITING and source.required and self.now_s >= 1000.0 + GRACE_S:
                assert f"{source.spec.name}.missing" in active
            if source.state is SourceState.RECEIVING and f"{source.spec.name}.stale" in active:
                assert self.now_s - active[f"{source.spec.name}.stale"].seen_s < CLEAR_AFTER_S
        assert self.raised - self.cleared == len(active)


Life.TestCase.settings = settings(max_examples=60, stateful_step_count=25)
TestLife = Life.TestCase
