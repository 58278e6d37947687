"""Whatever happens in whatever order: when the robot may move, and how fast."""

from dataclasses import astuple, replace
from itertools import combinations
from math import hypot
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

from drive.motion.machine import (
    Enable,
    EndLease,
    Event,
    GrantLease,
    Observe,
    OnLoss,
    Reset,
    Rules,
    State,
    Stop,
    Tick,
    step,
)
from drive.motion.phases import Phase
from drive.motion.shaping import Limits, approached, limited, supervised
from drive.motion.values import (
    MS,
    ZERO,
    Command,
    Inhibit,
    Lease,
    LeaseEnd,
    Supervision,
    Surroundings,
    Velocity,
)

SESSIONS = ("s1", "s2", "s3")
speeds = st.floats(-2, 2)
velocities = st.builds(Velocity, speeds, speeds, speeds)
offsets_ms = st.integers(-800, 800)
FLAWS = (
    "",
    "",
    "",
    "",
    "echo",
    "echo ahead",
    "picture",
    "picture ahead",
    "none",
    "expired",
    "other",
    "repeated",
    "nan",
    "infinite",
    "forever",
)


def _flawed(flaw: str, now_ns: int) -> dict[str, Any]:
    """Returns what is wrong with a command."""
    flaws: dict[str, dict[str, Any]] = {
        "echo": {"echo_ns": now_ns - 450 * MS},
        "echo ahead": {"echo_ns": now_ns + 1000 * MS},
        "picture": {"picture_ns": now_ns - 650 * MS},
        "picture ahead": {"picture_ns": now_ns + 1000 * MS},
        "none": {"picture_ns": 0},
        "expired": {"valid_until_ns": now_ns - 1},
        "forever": {"valid_until_ns": now_ns + 10**18},
        "other": {"session_id": "s3"},
        "nan": {"velocity": Velocity(vx_mps=float("nan"))},
        "infinite": {"velocity": Velocity(wz_rad_s=float("inf"))},
    }
    return flaws.get(flaw, {})


class Driving(RuleBasedStateMachine):
    """Feeds events, and judges every state by what was fed: the model keeps the newest facts itself."""

    @initialize(on_loss=st.sampled_from(OnLoss), ramp_s=st.sampled_from([0.0, 0.2]), enabled=st.booleans())
    def start(self, on_loss: OnLoss, ramp_s: float, enabled: bool) -> None:
        self.configured = Rules(on_loss=on_loss, release_ramp_s=ramp_s)
        self.now_ns = 10**12
        self.state = State.at_start(enabled=enabled)
        self.before = self.state
        self.event: Event = Tick()
        self.lease: Lease | None = None
        self.enabled = enabled
        self.sequence = 0
        self.newest: Command | None = None
        self.arrived_ns = 0
        self.released = False
        """Whether the driver has been seen not to hold, since the lease began or a stop was reset."""

    def feed(self, event: Event) -> None:
        self.before, self.event = self.state, event
        self.state = step(self.state, event, self.now_ns, self.configured)
        self.judge()

    def judge(self) -> None:
        """Judges each step: what a rule does in several of them must not pass unseen."""
        self.motion_has_every_reason()
        self.slowing_down_only_follows_a_release()
        self.motion_begins_with_a_press_after_a_release()
        self.limits_hold()
        self.nothing_is_published_when_no_one_drives()
        self.a_stop_stays_until_its_reset()
        self.the_sequence_only_grows()
        self.reasons_are_known_with_and_without_a_driver()

    @rule(ms=st.integers(0, 700))
    def pass_time(self, ms: int) -> None:
        self.now_ns += ms * MS
        self.feed(Tick())

    @rule(enabled=st.booleans())
    def enable(self, enabled: bool) -> None:
        self.enabled = enabled
        if not enabled:
            self.lease = None
        self.feed(Enable(enabled=enabled))

    @rule(
        session=st.sampled_from(SESSIONS), supervision=st.sampled_from(Supervision), streaming=st.booleans()
    )
    def grant(self, session: str, supervision: Supervision, streaming: bool) -> None:
        lease = Lease(session, session, supervision, streaming)
        if self.enabled:
            self.lease, self.newest, self.released = lease, None, False
        self.feed(GrantLease(lease))

    @rule(session=st.sampled_from(SESSIONS), why=st.sampled_from(LeaseEnd))
    def end(self, session: str, why: LeaseEnd) -> None:
        if self.lease and self.lease.session_id == session:
            self.lease = None
        self.feed(EndLease(session, why))

    @rule(
        session=st.sampled_from(SESSIONS),
        newer=st.booleans(),
        held=st.booleans(),
        velocity=velocities,
        instants_ms=st.tuples(offsets_ms, offsets_ms, offsets_ms),
    )
    def command(self, *, session: str, newer: bool, held: bool, velocity: Velocity, instants_ms: Any) -> None:
        """Sends anything that a decoder lets through."""
        self.sequence += newer
        valid, echo, picture = (self.now_ns + offset * MS for offset in instants_ms)
        self.send(Command(session, self.sequence, held, velocity, valid, echo, picture))

    @rule(held=st.booleans(), velocity=velocities, times=st.integers(1, 10), flaw=st.sampled_from(FLAWS))
    def drive(self, held: bool, velocity: Velocity, times: int, flaw: str = "") -> None:
        """Sends 50 commands a second as a client of the holder does, with at most one flaw."""
        for _ in range(times):
            self.now_ns += 20 * MS
            self.sequence += flaw != "repeated"
            now = self.now_ns
            proper = Command(
                session_id=self.lease.session_id if self.lease else "s1",
                sequence=self.sequence,
                held=held,
                velocity=velocity,
                valid_until_ns=now + 250 * MS,
                echo_ns=now,
                picture_ns=now - 20 * MS,
            )
            self.send(replace(proper, **_flawed(flaw, now)))

    def send(self, command: Command) -> None:
        mine = self.lease is not None and command.session_id == self.lease.session_id
        newer = self.newest is None or command.sequence > self.newest.sequence
        if mine and newer and command.velocity.is_finite:
            self.newest, self.arrived_ns = command, self.now_ns
            self.released = self.released or not command.held
        self.feed(command)

    @precondition(lambda self: self.state.phase is not Phase.DRIVING)
    @rule(
        supervision=st.sampled_from(Supervision),
        streaming=st.booleans(),
        velocity=velocities,
        flaw=st.sampled_from(["", "forever"]),
        times=st.sampled_from([5, 40]),
    )
    def set_off(
        self, supervision: Supervision, streaming: bool, velocity: Velocity, flaw: str, times: int
    ) -> None:
        """Does everything that it takes to drive, perhaps until it is as fast as it may be."""
        self.drive(held=False, velocity=ZERO, times=1)
        self.all_clear()
        self.reset(right=True)
        self.enable(enabled=True)
        self.grant(session="s1", supervision=supervision, streaming=streaming)
        self.drive(held=False, velocity=ZERO, times=1)
        self.drive(held=True, velocity=velocity, times=times, flaw=flaw)
        assert self.state.phase is Phase.DRIVING

    @rule(
        session=st.sampled_from(SESSIONS),
        supervision=st.sampled_from(Supervision),
        velocity=velocities,
        stopped=st.booleans(),
    )
    def hold_without_a_release(
        self, session: str, supervision: Supervision, velocity: Velocity, stopped: bool
    ) -> None:
        """Holds right after a reset, or as another session: no release before that counts."""
        self.enable(enabled=True)
        self.all_clear()
        self.drive(held=False, velocity=ZERO, times=1)
        if stopped:
            self.stop(by="anna")
        self.reset(right=True)
        if not stopped or self.lease is None:
            self.grant(session=session, supervision=supervision, streaming=True)
        streaming = self.lease is not None and self.lease.streaming
        self.drive(held=True, velocity=velocity, times=3)
        assert not (streaming and self.state.phase is Phase.DRIVING)

    @rule(by=st.sampled_from(["anna", "ben"]))
    def stop(self, by: str) -> None:
        number = self.state.last_stop_id
        self.feed(Stop(by))
        assert self.state.phase is Phase.STOPPED
        assert self.state.output == ZERO
        assert self.state.latch
        assert self.state.latch.stop_id > number, "no reset has seen it"

    @rule(bad=st.sampled_from("ocu"), silent_ms=st.sampled_from([0, 250, 251]))
    def reset_beside_another_source(self, bad: str, silent_ms: int) -> None:
        """Stops, and resets while another source moves the robot, or would."""
        self.drive(held=False, velocity=ZERO, times=1)
        self.stop(by="anna")
        self.observe(running=True, newest_ms=0, base=True, bad=bad)
        self.pass_time(silent_ms)
        self.reset(right=True)
        streaming = self.lease is not None and self.lease.streaming
        assert (self.state.latch is None) == (bad != "o" and streaming and silent_ms <= 250)

    @rule(right=st.booleans())
    def reset(self, right: bool) -> None:
        latch = self.state.latch
        self.feed(Reset(latch.stop_id if latch and right else 0))
        if self.before.phase is Phase.STOPPED:
            assert self.state.output in (None, ZERO)
        if self.state.latch is None and latch is not None:
            # What was held before the reset is unknown to it, and starts nothing.
            self.newest, self.released = None, False

    @rule(
        running=st.booleans(),
        newest_ms=st.integers(-900, 0),
        base=st.booleans(),
        bad=st.sampled_from("sofncu"),
    )
    def observe(self, running: bool, newest_ms: int, base: bool, bad: str) -> None:
        good = Surroundings(preview_running=True, newest_capture_ns=10**18, base_present=True, still=True)
        kinds: dict[str, dict[str, Any]] = {
            "s": {"robot_stopped": True},
            "o": {"outranked": True},
            "f": {"preview_running": running, "newest_capture_ns": self.now_ns + newest_ms * MS},
            "n": {"base_present": base, "still": None},
            "c": {"commanded_on": ("/cmd_vel_autonomy",)},
            "u": {"sources_known": False},
        }
        self.feed(Observe(replace(good, **kinds[bad])))

    @rule()
    def all_clear(self) -> None:
        good = Surroundings(preview_running=True, newest_capture_ns=10**18, base_present=True, still=True)
        self.feed(Observe(good))

    def moves(self) -> bool:
        return self.state.output not in (None, ZERO)

    def motion_has_every_reason(self) -> None:
        state = self.state
        if not self.moves():
            return
        lease, command, around = self.lease, self.newest, state.surroundings
        assert self.enabled
        assert lease is not None
        assert lease == state.lease
        assert command is not None
        assert self.now_ns <= command.valid_until_ns
        assert self.now_ns <= self.arrived_ns + (250 if lease.streaming else 500) * MS
        assert state.latch is None
        if state.phase is Phase.STOPPING:
            return
        assert state.phase is Phase.DRIVING
        assert command.held
        assert around.base_present
        assert not around.robot_stopped
        assert not around.outranked
        if lease.streaming:
            assert command.echo_ns <= self.arrived_ns
            assert self.now_ns - command.echo_ns <= 400 * MS
        if lease.supervision is Supervision.PICTURE:
            assert around.preview_running
            assert command.picture_ns <= self.arrived_ns + 20 * MS
            assert command.picture_ns <= around.newest_capture_ns + 20 * MS
            assert self.now_ns - command.picture_ns <= 600 * MS

    def slowing_down_only_follows_a_release(self) -> None:
        if self.moves() and self.state.phase is Phase.STOPPING:
            assert self.configured.release_ramp_s > 0
            assert self.lease
            assert self.lease == self.before.lease, "of the driver who has released, and of no other"
            assert self.lease.streaming
            assert self.newest
            assert not self.newest.held
            assert not self.state.inhibits
            assert self.before.phase in {Phase.DRIVING, Phase.STOPPING}
            assert _no_faster(self.state.output, self.before.output)

    def motion_begins_with_a_press_after_a_release(self) -> None:
        before, state = self.before, self.state
        if state.phase is not Phase.DRIVING or before.phase is Phase.DRIVING:
            return
        assert before.phase in {Phase.ARMED, Phase.STOPPING}
        assert isinstance(self.event, Command)
        assert self.event.held
        if state.lease and state.lease.streaming:
            assert before.lease == state.lease
            assert before.command is not None
            assert not before.command.held
            assert self.released

    def limits_hold(self) -> None:
        limits, output = self.configured.limits, self.state.output
        if output is None:
            return
        assert abs(output.vx_mps) <= limits.vx_mps + 1e-9
        assert abs(output.vy_mps) <= limits.vy_mps + 1e-9
        assert abs(output.wz_rad_s) <= limits.wz_rad_s + 1e-9
        rim_mps = abs(output.vx_mps) + abs(output.vy_mps) + limits.wheel_lever_m * abs(output.wz_rad_s)
        assert rim_mps <= limits.wheel_mps + 1e-9
        if self.state.phase is Phase.DRIVING and self.lease and self.newest:
            by_eye = self.lease.supervision is Supervision.LINE_OF_SIGHT
            age_s = (self.now_ns - self.newest.picture_ns) / 1e9
            assert not by_eye or output.linear_mps <= limits.line_of_sight_mps + 1e-9
            assert by_eye or output.linear_mps * age_s <= limits.picture_travel_m + 1e-9
            assert not by_eye or abs(output.wz_rad_s) <= limits.line_of_sight_rad_s + 1e-9
            assert by_eye or abs(output.wz_rad_s) * age_s <= limits.picture_turn_rad + 1e-9
        elapsed_s = (self.state.output_ns - self.before.output_ns) / 1e9
        previous = self.before.output or ZERO
        for name, limit in (
            ("vx_mps", limits.acceleration_mps2),
            ("vy_mps", limits.acceleration_mps2),
            ("wz_rad_s", limits.acceleration_rad_s2),
        ):
            grown = abs(getattr(output, name)) - abs(getattr(previous, name))
            assert grown <= limit * elapsed_s + 1e-9

    def nothing_is_published_when_no_one_drives(self) -> None:
        silent = self.state.phase in {Phase.DISABLED, Phase.AVAILABLE}
        assert (self.state.output is None) == silent
        if silent:
            assert self.before.output in (None, ZERO), "the last is zero"

    def a_stop_stays_until_its_reset(self) -> None:
        if self.before.phase is Phase.STOPPED and self.state.phase is not Phase.STOPPED:
            assert isinstance(self.event, Reset)
            assert self.before.latch is not None
            assert self.event.stop_id == self.before.latch.stop_id
            assert not self.before.holding(self.now_ns)
            around = self.before.surroundings
            assert not around.outranked
            quiet = around.sources_known and not around.commanded_on
            assert self.driver_is_heard() or quiet, "the reset would leave it to another source"

    def driver_is_heard(self) -> bool:
        """Whether the driver's program is there: a lease outlives it."""
        if self.lease is None or self.newest is None:
            return False
        valid_until_ns = min(self.newest.valid_until_ns, self.arrived_ns + 250 * MS)
        return self.lease.streaming and self.now_ns <= valid_until_ns

    def reasons_are_known_with_and_without_a_driver(self) -> None:
        state, around = self.state, self.state.surroundings
        assert (Inhibit.ROBOT_STOP in state.inhibits) == around.robot_stopped
        assert (Inhibit.BASE_ABSENT in state.inhibits) == (not around.base_present)
        if self.lease is None:
            assert state.phase is not Phase.INHIBITED, "of which only a driver's release is the end"
            assert state.inhibits <= {Inhibit.ROBOT_STOP, Inhibit.BASE_ABSENT, Inhibit.OUTRANKED}
            silent = self.before.output is None
            assert (Inhibit.OUTRANKED in state.inhibits) == (around.outranked and not silent)

    def the_sequence_only_grows(self) -> None:
        before, after = self.before.command, self.state.command
        if before and after and self.before.lease == self.state.lease:
            assert after is before or after.sequence > before.sequence


def _no_faster(after: Velocity | None, before: Velocity | None) -> bool:
    after, before = after or ZERO, before or ZERO
    return after.linear_mps <= before.linear_mps + 1e-9 and abs(after.wz_rad_s) <= abs(before.wz_rad_s) + 1e-9


TestDriving = Driving.TestCase
TestDriving.settings = settings(max_examples=150, stateful_step_count=60)


@given(velocities)
def test_limits_keep_the_direction(wanted: Velocity) -> None:
    limits = Limits()
    slowed = limited(wanted, limits)
    rim = abs(slowed.vx_mps) + abs(slowed.vy_mps) + limits.wheel_lever_m * abs(slowed.wz_rad_s)
    assert rim <= limits.wheel_mps + 1e-9
    assert abs(slowed.vx_mps * wanted.vy_mps - slowed.vy_mps * wanted.vx_mps) < 1e-9
    assert abs(slowed.vx_mps * wanted.wz_rad_s - slowed.wz_rad_s * wanted.vx_mps) < 1e-9
    assert slowed.vx_mps * wanted.vx_mps >= 0


@given(velocities, st.floats(0.001, 0.6))
def test_no_farther_than_the_picture_allows(wanted: Velocity, age_s: float) -> None:
    limits = Limits()
    slowed = supervised(wanted, Supervision.PICTURE, age_s, limits)
    assert slowed.linear_mps * age_s <= limits.picture_travel_m + 1e-9
    assert abs(slowed.wz_rad_s) * age_s <= limits.picture_turn_rad + 1e-9


@given(velocities, velocities, st.floats(0, 1))
def test_an_approach_never_overshoots(current: Velocity, target: Velocity, elapsed_s: float) -> None:
    after = approached(current, target, elapsed_s, Limits())
    for name in ("vx_mps", "vy_mps", "wz_rad_s"):
        reached, wanted = getattr(after, name), getattr(target, name)
        assert abs(reached) <= abs(wanted)
        assert reached * wanted >= 0
        if getattr(current, name) * wanted < 0:
            assert abs(reached) <= 1.6 * elapsed_s + 1e-9, "from zero on"


@given(velocities, velocities, st.floats(0, 1))
@example(ZERO, Velocity(0.2, 0.05), 0.02)
@example(Velocity(0.1, 0.1), Velocity(0.3, -0.1, 0.4), 0.02)
def test_an_approach_speeds_up_in_the_direction_of_its_change(
    current: Velocity, target: Velocity, elapsed_s: float
) -> None:
    limits = Limits()
    after = approached(current, target, elapsed_s, limits)
    grown, missing = [], []
    for now, reached, wanted in zip(astuple(current), astuple(after), astuple(target), strict=True):
        slower = wanted if abs(wanted) <= abs(now) else now
        at_once = 0.0 if now * wanted < 0 else slower
        grown.append(reached - at_once)
        missing.append(wanted - at_once)
    for one, other in combinations(range(3), 2):
        assert abs(grown[one] * missing[other] - grown[other] * missing[one]) < 1e-9
    assert hypot(*grown[:2]) <= limits.acceleration_mps2 * elapsed_s + 1e-9
    assert abs(grown[2]) <= limits.acceleration_rad_s2 * elapsed_s + 1e-9
    assert approached(current, target, 10.0, limits) == target


@given(velocities)
def test_an_approach_from_a_standstill_takes_as_long_as_its_slowest_part(target: Velocity) -> None:
    limits = Limits()
    needed_s = max(
        target.linear_mps / limits.acceleration_mps2, abs(target.wz_rad_s) / limits.acceleration_rad_s2
    )
    half = approached(ZERO, target, needed_s / 2, limits)
    assert astuple(half) == pytest.approx(astuple(target.scaled(0.5)), abs=1e-9)
    assert astuple(approached(ZERO, target, needed_s, limits)) == pytest.approx(astuple(target), abs=1e-9)
