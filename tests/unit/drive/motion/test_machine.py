"""Every transition of driving, written out once more from the design: the table must not be its own judge."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import pytest

from drive.motion.inhibits import Deadlines
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
    reset_obstacle,
    step,
)
from drive.motion.phases import REST, TRANSITIONS, Phase, Trigger
from drive.motion.shaping import Limits
from drive.motion.values import (
    MS,
    ZERO,
    Command,
    Inhibit,
    Latch,
    Lease,
    LeaseEnd,
    Supervision,
    Surroundings,
    Velocity,
)

RULES = Rules()
HAND_BACK = Rules(on_loss=OnLoss.HAND_BACK)
CLEAR = Surroundings(preview_running=True, newest_capture_ns=10**18, base_present=True, still=True)
FORWARD = Velocity(vx_mps=0.2)


class Robot:
    """A robot driven by one session, on a clock that moves by hand."""

    def __init__(self, rules: Rules = RULES, *, streaming: bool = True) -> None:
        self.rules = rules
        self.now_ns = 1_000_000 * MS
        self.sequence = 0
        self.lease = Lease("s1", "anna", streaming=streaming) if streaming else legacy("s1")
        self.state = State.at_start(enabled=True)
        self.feed(Observe(CLEAR))

    @property
    def forward_mps(self) -> float:
        assert self.state.output is not None
        return self.state.output.vx_mps

    @property
    def stop_id(self) -> int:
        assert self.state.latch is not None
        return self.state.latch.stop_id

    def feed(self, event: Event) -> State:
        self.state = step(self.state, event, self.now_ns, self.rules)
        return self.state

    def after(self, ms: float, event: Event | None = None) -> State:
        self.now_ns += int(ms * MS)
        return self.feed(event or Tick())

    def command(self, *, held: bool, velocity: Velocity = FORWARD, **changes: Any) -> State:
        self.sequence += 1
        command = Command(
            session_id=self.lease.session_id,
            sequence=self.sequence,
            held=held,
            velocity=velocity if held else ZERO,
            valid_until_ns=self.now_ns + 250 * MS,
            echo_ns=self.now_ns,
            picture_ns=self.now_ns - 20 * MS,
        )
        return self.feed(replace(command, **changes))

    def armed(self) -> "Robot":
        self.feed(GrantLease(self.lease))
        self.command(held=False)
        return self

    def driving(self) -> "Robot":
        self.armed().command(held=True)
        return self

    def driven(self, ms: int) -> State:
        """Holds for a while, with a command every 20 ms."""
        for _ in range(ms // 20):
            self.now_ns += 20 * MS
            self.command(held=True)
        return self.state


def legacy(session_id: str) -> Lease:
    return Lease(session_id, "old tool", Supervision.LINE_OF_SIGHT, streaming=False)


def in_phase(phase: Phase) -> Robot:
    robot = Robot()
    match phase:
        case Phase.DISABLED:
            robot.feed(Enable(enabled=False))
        case Phase.ARMED:
            robot.armed()
        case Phase.DRIVING:
            robot.driving()
        case Phase.STOPPING:
            robot.feed(Observe(replace(CLEAR, still=False)))
            robot.driving().command(held=False)
        case Phase.INHIBITED:
            robot.driving().feed(Observe(replace(CLEAR, robot_stopped=True)))
            robot.feed(Observe(CLEAR))
        case Phase.STOPPED:
            robot.driving().feed(Stop("ben"))
    assert robot.state.phase is phase
    return robot


OTHER = Lease("s2", "ben")
EXPECTED = {
    (Phase.DISABLED, "enable"): Phase.AVAILABLE,
    (Phase.DISABLED, "stop"): Phase.STOPPED,
    (Phase.AVAILABLE, "disable"): Phase.DISABLED,
    (Phase.AVAILABLE, "lease"): Phase.ARMED,
    (Phase.AVAILABLE, "stop"): Phase.STOPPED,
    (Phase.ARMED, "disable"): Phase.STOPPING,
    (Phase.ARMED, "lease closed"): Phase.STOPPING,
    (Phase.ARMED, "lease lost"): Phase.STOPPING,
    (Phase.ARMED, "stop"): Phase.STOPPED,
    (Phase.ARMED, "robot's stop"): Phase.INHIBITED,
    (Phase.ARMED, "hold"): Phase.DRIVING,
    (Phase.DRIVING, "disable"): Phase.STOPPING,
    (Phase.DRIVING, "lease"): Phase.ARMED,  # By way of STOPPING, as odometry shows no motion.
    (Phase.DRIVING, "lease closed"): Phase.STOPPING,
    (Phase.DRIVING, "lease lost"): Phase.STOPPED,
    (Phase.DRIVING, "stop"): Phase.STOPPED,
    (Phase.DRIVING, "robot's stop"): Phase.INHIBITED,
    (Phase.DRIVING, "release"): Phase.ARMED,  # Odometry shows no motion.
    (Phase.STOPPING, "stop"): Phase.STOPPED,
    (Phase.STOPPING, "robot's stop"): Phase.INHIBITED,
    (Phase.STOPPING, "hold"): Phase.DRIVING,
    (Phase.STOPPING, "standstill"): Phase.ARMED,
    (Phase.INHIBITED, "disable"): Phase.STOPPING,
    (Phase.INHIBITED, "lease closed"): Phase.STOPPING,
    (Phase.INHIBITED, "lease lost"): Phase.STOPPED,  # The driver still held.
    (Phase.INHIBITED, "stop"): Phase.STOPPED,
    (Phase.INHIBITED, "release"): Phase.ARMED,
}
EVENTS = {
    "enable": lambda robot: robot.feed(Enable(enabled=True)),
    "disable": lambda robot: robot.feed(Enable(enabled=False)),
    "lease": lambda robot: robot.feed(GrantLease(OTHER)),
    "lease closed": lambda robot: robot.feed(EndLease("s1", LeaseEnd.CLOSED)),
    "lease lost": lambda robot: robot.feed(EndLease("s1", LeaseEnd.LOST)),
    "stop": lambda robot: robot.feed(Stop("carl")),
    "robot's stop": lambda robot: robot.feed(Observe(replace(CLEAR, robot_stopped=True))),
    "hold": lambda robot: robot.command(held=True),
    "release": lambda robot: robot.command(held=False),
    "standstill": lambda robot: robot.feed(Observe(CLEAR)),
    "other's reset": lambda robot: robot.feed(Reset(99)),
}


@pytest.mark.parametrize("phase", Phase)
@pytest.mark.parametrize("event", EVENTS)
def test_every_pair_of_phase_and_event(phase: Phase, event: str) -> None:
    robot = in_phase(phase)
    EVENTS[event](robot)
    assert robot.state.phase is EXPECTED.get((phase, event), phase)


MOVING = {(Phase.DRIVING, "lease"): Phase.STOPPING, (Phase.DRIVING, "release"): Phase.STOPPING}


@pytest.mark.parametrize("phase", Phase)
@pytest.mark.parametrize("event", sorted(EVENTS.keys() - {"robot's stop", "standstill"}))
def test_every_pair_while_odometry_shows_motion(phase: Phase, event: str) -> None:
    """Nothing passes through STOPPING unseen: it would end there for now."""
    robot = in_phase(phase)
    robot.feed(Observe(replace(CLEAR, still=False)))
    EVENTS[event](robot)
    assert robot.state.phase is (EXPECTED | MOVING).get((phase, event), phase)


RESTS = [(True, True, Phase.ARMED), (True, False, Phase.AVAILABLE), (False, False, Phase.DISABLED)]


@pytest.mark.parametrize(("enabled", "leased", "rest"), RESTS)
def test_a_reset_ends_where_it_should(enabled: bool, leased: bool, rest: Phase) -> None:
    robot = in_phase(Phase.STOPPED)
    robot.feed(Observe(replace(CLEAR, still=False)))
    robot.command(held=False)
    if not leased:
        robot.feed(EndLease("s1", LeaseEnd.CLOSED))
    robot.feed(Enable(enabled=enabled))
    robot.feed(Reset(robot.stop_id))
    assert robot.state.phase is rest
    # A driver whose command the reset has made unknown shows the release again first.
    robot.command(held=False)
    assert robot.state.phase is rest


@pytest.mark.parametrize(
    ("enabled", "rest"), [(True, Phase.AVAILABLE), (False, Phase.DISABLED)], ids=["enabled", "disabled"]
)
def test_the_robot_is_handed_back_after_zeros(enabled: bool, rest: Phase) -> None:
    robot = in_phase(Phase.ARMED)
    robot.feed(EndLease("s1", LeaseEnd.CLOSED))
    robot.feed(Enable(enabled=enabled))
    assert robot.after(499).output == ZERO
    assert robot.state.phase is Phase.STOPPING
    assert robot.after(1).phase is rest
    assert robot.state.output is None


def test_standstill_is_assumed_after_a_second_without_odometry() -> None:
    robot = Robot()
    robot.feed(Observe(replace(CLEAR, still=None)))
    robot.driving().command(held=False)
    for _ in range(49):
        robot.now_ns += 20 * MS
        assert robot.command(held=False).phase is Phase.STOPPING
    robot.now_ns += 20 * MS
    assert robot.command(held=False).phase is Phase.ARMED


def test_a_hold_that_began_before_the_session_does_not_move() -> None:
    robot = Robot()
    robot.feed(GrantLease(robot.lease))
    assert robot.driven(200).output == ZERO
    assert robot.state.phase is not Phase.DRIVING
    robot.command(held=False)
    assert robot.command(held=True).phase is Phase.DRIVING


def test_a_hold_that_goes_on_through_an_inhibit_does_not_move_again() -> None:
    robot = in_phase(Phase.INHIBITED)
    assert robot.driven(200).phase is Phase.INHIBITED
    assert robot.state.output == ZERO
    robot.command(held=False)
    robot.command(held=True)
    robot.after(20)
    assert robot.forward_mps > 0


def test_pressing_during_an_inhibit_does_not_move_when_it_ends() -> None:
    robot = in_phase(Phase.INHIBITED)
    robot.feed(Observe(replace(CLEAR, robot_stopped=True)))
    robot.command(held=False)
    robot.command(held=True)
    robot.feed(Observe(CLEAR))
    assert robot.driven(100).phase is Phase.INHIBITED


def test_a_drive_gets_as_fast_as_the_limits_permit_and_no_faster() -> None:
    robot = Robot().driving()
    for _ in range(50):
        robot.now_ns += 20 * MS
        robot.command(held=True, velocity=Velocity(vx_mps=2.0))
    assert robot.forward_mps == pytest.approx(RULES.limits.wheel_mps)


def test_a_release_of_the_session_before_counts_for_nothing() -> None:
    robot = Robot().armed()
    robot.lease = Lease("s2", "ben")
    robot.feed(GrantLease(robot.lease))
    assert robot.command(held=True).phase is Phase.ARMED
    robot.command(held=False)
    assert robot.command(held=True).phase is Phase.DRIVING


def test_a_reset_never_moves_and_waits_for_the_release() -> None:
    robot = in_phase(Phase.STOPPED)
    stop_id = robot.stop_id
    robot.driven(100)
    assert robot.feed(Reset(stop_id)).latch is not None, "the driver holds"
    robot.command(held=False)
    robot.feed(Reset(stop_id))
    assert robot.state.latch is None
    assert robot.driven(100).output == ZERO
    robot.command(held=False)
    assert robot.command(held=True).phase is Phase.DRIVING


def test_a_reset_leaves_the_robot_to_no_source_that_goes_on() -> None:
    robot = Robot()
    robot.feed(Stop("ben"))
    robot.feed(Observe(replace(CLEAR, commanded_on=("/cmd_vel_nav",))))
    assert "/cmd_vel_nav" in reset_obstacle(robot.state, robot.now_ns)
    assert robot.feed(Reset(robot.stop_id)).latch
    for doubt in (replace(CLEAR, outranked=True), replace(CLEAR, sources_known=False)):
        robot.feed(Observe(doubt))
        assert robot.feed(Reset(robot.stop_id)).latch
    robot.feed(Observe(CLEAR))
    assert not reset_obstacle(robot.state, robot.now_ns)
    assert robot.feed(Reset(robot.stop_id)).phase is Phase.AVAILABLE


def test_a_driver_who_keeps_other_sources_away_resets_the_stop() -> None:
    robot = in_phase(Phase.STOPPED)
    robot.feed(Observe(replace(CLEAR, commanded_on=("/cmd_vel_nav",))))
    robot.command(held=False)
    assert robot.feed(Reset(robot.stop_id)).phase is Phase.ARMED


@pytest.mark.parametrize(
    "source", [replace(CLEAR, commanded_on=("/cmd_vel_nav",)), replace(CLEAR, sources_known=False)]
)
def test_a_lease_without_a_driver_who_is_heard_keeps_no_source_away(source: Surroundings) -> None:
    """The lease of a driver's program that is dead ends within 2 s, and leaves the robot to the source."""
    robot = in_phase(Phase.STOPPED)
    robot.feed(Observe(source))
    robot.command(held=False)
    robot.after(251)
    assert reset_obstacle(robot.state, robot.now_ns)
    assert robot.feed(Reset(robot.stop_id)).latch
    robot.command(held=False)
    robot.after(250)
    assert robot.feed(Reset(robot.stop_id)).latch is None


def test_a_lease_before_its_first_command_keeps_no_source_away() -> None:
    robot = Robot()
    robot.feed(Stop("ben"))
    robot.feed(Observe(replace(CLEAR, commanded_on=("/cmd_vel_nav",))))
    robot.feed(GrantLease(robot.lease))
    assert robot.feed(Reset(robot.stop_id)).latch


def test_an_older_tools_command_keeps_no_source_away() -> None:
    """Its lease ends by itself, without a driver who could release it."""
    robot = Robot(streaming=False)
    robot.feed(GrantLease(robot.lease))
    robot.feed(Stop("ben"))
    robot.feed(Observe(replace(CLEAR, commanded_on=("/cmd_vel_nav",))))
    robot.command(held=False)
    assert robot.feed(Reset(robot.stop_id)).latch


def test_a_lost_driver_does_not_hide_who_stopped_the_robot() -> None:
    robot = in_phase(Phase.STOPPED)
    latch = robot.state.latch
    robot.driven(100)
    robot.feed(EndLease("s1", LeaseEnd.LOST))
    assert robot.state.latch == latch


def test_an_older_tool_that_goes_after_its_command_has_ended_leaves_no_stop() -> None:
    robot = Robot(streaming=False)
    robot.feed(GrantLease(robot.lease))
    robot.command(held=True, valid_until_ns=10**18)
    robot.after(501)
    robot.feed(EndLease("s1", LeaseEnd.LOST))
    assert robot.state.latch is None
    assert robot.after(500).phase is Phase.AVAILABLE


@pytest.mark.parametrize("end", [EndLease("s1", LeaseEnd.CLOSED), Enable(enabled=False)])
def test_the_zeros_for_others_start_again_with_the_end_of_the_lease(end: Event) -> None:
    robot = in_phase(Phase.STOPPING)
    for _ in range(20):
        robot.now_ns += 20 * MS
        assert robot.command(held=False).phase is Phase.STOPPING
    robot.feed(end)
    assert robot.after(499).phase is Phase.STOPPING
    assert robot.after(1).phase in {Phase.AVAILABLE, Phase.DISABLED}


@pytest.mark.parametrize("by", ["carl", "ben"], ids=["another", "the same, perhaps of two people"])
def test_each_stop_needs_a_reset_that_has_seen_it(by: str) -> None:
    robot = in_phase(Phase.STOPPED)
    first = robot.stop_id
    robot.command(held=False)
    robot.feed(Stop(by, "again"))
    assert robot.state.latch == Latch(first + 1, by, "again")
    assert robot.feed(Reset(first)).phase is Phase.STOPPED
    assert robot.feed(Reset(robot.stop_id)).phase is not Phase.STOPPED


def test_a_stop_outlives_the_process() -> None:
    latch = in_phase(Phase.STOPPED).state.latch
    assert latch is not None
    state = State.at_start(10**12, enabled=True, latch=latch)
    assert state.phase is Phase.STOPPED
    assert not state.locked(10**12 + 299 * MS), "zeros first, also after a restart"
    assert state.locked(10**12 + 300 * MS)
    state = step(state, Stop("carl"), 10**12, RULES)
    assert state.latch is not None
    assert state.latch.stop_id == latch.stop_id + 1


def test_numbers_of_stops_go_on_after_a_restart() -> None:
    state = step(State.at_start(enabled=True, last_stop_id=7), Stop("carl"), 1, RULES)
    assert state.latch is not None
    assert state.latch.stop_id == 8


def test_the_lock_follows_the_zeros() -> None:
    robot = in_phase(Phase.STOPPED)
    robot.after(299)
    assert (robot.state.output, robot.state.locked(robot.now_ns)) == (ZERO, False)
    robot.after(1)
    assert (robot.state.output, robot.state.locked(robot.now_ns)) == (ZERO, True)


@pytest.mark.parametrize("why", [LeaseEnd.LOST, LeaseEnd.ACCESS_ENDED])
def test_a_lost_driver_leaves_the_robot_as_configured(why: LeaseEnd) -> None:
    robot = Robot().driving()
    robot.feed(EndLease("s1", why))
    assert robot.state.phase is Phase.STOPPED
    assert robot.state.latch is not None
    assert robot.state.latch.by == "anna"
    robot = Robot(HAND_BACK).driving()
    robot.feed(EndLease("s1", why))
    assert robot.state.phase is Phase.STOPPING
    assert robot.after(500).phase is Phase.AVAILABLE


@pytest.mark.parametrize("rules", [RULES, HAND_BACK])
def test_a_driver_lost_without_holding_hands_the_robot_back(rules: Rules) -> None:
    robot = Robot(rules).armed()
    assert robot.feed(EndLease("s1", LeaseEnd.LOST)).phase is Phase.STOPPING


def test_silence_stops_after_the_validity_of_the_last_command() -> None:
    robot = Robot().driving()
    robot.driven(100)
    robot.after(250)
    assert robot.forward_mps > 0
    assert robot.after(1).output == ZERO
    assert robot.state.inhibits == {Inhibit.COMMAND_LATE}


def test_no_command_is_valid_for_longer_than_configured() -> None:
    robot = Robot().armed()
    robot.command(held=True, valid_until_ns=10**18)
    assert robot.after(251).output == ZERO


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"echo_ns": -401 * MS}, Inhibit.LOOP_LATE),
        ({"echo_ns": +1}, Inhibit.LOOP_LATE),
        ({"picture_ns": -601 * MS}, Inhibit.PICTURE_STALE),
        ({"picture_ns": +21 * MS}, Inhibit.PICTURE_MISSING),
        ({"valid_until_ns": -1}, Inhibit.COMMAND_LATE),
    ],
)
def test_commands_that_must_not_move(changes: dict[str, int], expected: Inhibit) -> None:
    robot = Robot().driving()
    robot.after(20)
    robot.command(held=True, **_from(robot.now_ns, changes))
    assert robot.state.inhibits == {expected}
    assert robot.state.output == ZERO


@pytest.mark.parametrize(
    ("surroundings", "expected"),
    [
        (replace(CLEAR, preview_running=False), Inhibit.PICTURE_MISSING),
        (replace(CLEAR, newest_capture_ns=1), Inhibit.PICTURE_MISSING),
        (replace(CLEAR, base_present=False), Inhibit.BASE_ABSENT),
        (replace(CLEAR, outranked=True), Inhibit.OUTRANKED),
        (replace(CLEAR, robot_stopped=True), Inhibit.ROBOT_STOP),
    ],
)
def test_surroundings_that_must_not_move(surroundings: Surroundings, expected: Inhibit) -> None:
    robot = Robot().driving()
    robot.feed(Observe(surroundings))
    assert robot.state.inhibits == {expected}
    assert robot.state.output == ZERO


@pytest.mark.parametrize(
    ("surroundings", "expected"),
    [
        (replace(CLEAR, robot_stopped=True), {Inhibit.ROBOT_STOP}),
        (replace(CLEAR, base_present=False), {Inhibit.BASE_ABSENT}),
        (replace(CLEAR, preview_running=False), set()),
        (replace(CLEAR, outranked=True), set()),
    ],
    ids=["the robot's own stop", "no base", "no picture", "another source has the robot"],
)
@pytest.mark.parametrize("phase", [Phase.DISABLED, Phase.AVAILABLE])
def test_without_a_driver_the_robots_own_reasons_are_known_and_change_no_phase(
    phase: Phase, surroundings: Surroundings, expected: set[Inhibit]
) -> None:
    """A picture is a driver's; and what moves the robot then need not outrank one."""
    robot = in_phase(phase)
    robot.feed(Observe(surroundings))
    assert robot.state.inhibits == expected
    assert (robot.state.phase, robot.state.output) == (phase, None)
    robot.feed(Observe(CLEAR))
    assert not robot.state.inhibits


def test_a_source_that_moves_the_robot_past_the_zeros_of_a_stop_is_a_reason_without_a_driver() -> None:
    robot = Robot()
    robot.feed(Stop("ben"))
    robot.feed(Observe(replace(CLEAR, outranked=True)))
    assert robot.state.inhibits == {Inhibit.OUTRANKED}


def test_the_robots_own_stop_does_not_keep_it_from_others_after_a_drive() -> None:
    robot = Robot().armed()
    robot.feed(EndLease("s1", LeaseEnd.CLOSED))
    robot.feed(Observe(replace(CLEAR, robot_stopped=True)))
    assert robot.state.phase is Phase.STOPPING
    assert robot.after(500).phase is Phase.AVAILABLE
    assert robot.state.inhibits == {Inhibit.ROBOT_STOP}


def test_a_driver_who_comes_while_the_robots_own_stop_is_active_is_inhibited_at_once() -> None:
    robot = Robot()
    robot.feed(Observe(replace(CLEAR, robot_stopped=True)))
    assert robot.armed().state.phase is Phase.INHIBITED


def test_only_the_holders_newer_commands_count() -> None:
    robot = Robot().driving()
    newest = robot.state.command
    assert newest is not None
    robot.feed(replace(newest, held=False))
    robot.feed(replace(newest, held=False, sequence=newest.sequence - 1))
    robot.feed(replace(newest, held=False, session_id="s2", sequence=99))
    robot.feed(replace(newest, velocity=Velocity(vx_mps=float("nan")), sequence=99))
    assert robot.state.command == newest
    assert robot.state.phase is Phase.DRIVING
    assert robot.state.ignored == 4


def test_an_older_tools_command_moves_for_half_a_second() -> None:
    robot = Robot(streaming=False)
    robot.feed(GrantLease(robot.lease))
    robot.command(held=True, valid_until_ns=10**18)
    assert robot.state.phase is Phase.DRIVING
    robot.after(500)
    assert robot.forward_mps == pytest.approx(0.15)
    assert robot.after(1).output == ZERO
    robot.command(held=True, valid_until_ns=10**18)
    assert robot.state.phase is Phase.DRIVING


@pytest.mark.parametrize(
    ("mps", "rad_s", "unary_ms"), [(0.05, 0.1, 200), (0.15, 0.4, 500), (0.25, 0.6, 400)], ids=str
)
def test_an_older_tools_command_keeps_to_the_caps_and_the_time_of_the_configuration(
    mps: float, rad_s: float, unary_ms: int
) -> None:
    limits = Limits(line_of_sight_mps=mps, line_of_sight_rad_s=rad_s, wheel_mps=0)
    rules = Rules(limits=limits, deadlines=Deadlines(unary_ns=unary_ms * MS))
    fastest: dict[str, float] = {}
    for name, wanted in (("vx_mps", Velocity(vx_mps=0.35)), ("wz_rad_s", Velocity(wz_rad_s=0.8))):
        robot = Robot(rules, streaming=False)
        robot.feed(GrantLease(robot.lease))
        robot.command(held=True, velocity=wanted, valid_until_ns=10**18)
        for _ in range(unary_ms // 20):
            robot.after(20)
            fastest[name] = max(fastest.get(name, 0.0), getattr(robot.state.output, name))
        assert robot.after(1).output == ZERO
    assert fastest == pytest.approx({"vx_mps": mps, "wz_rad_s": rad_s})


def test_speed_grows_at_the_limit_and_ends_at_once() -> None:
    robot = Robot().driving()
    assert robot.state.output == ZERO
    robot.now_ns += 20 * MS
    robot.command(held=True)
    assert robot.forward_mps == pytest.approx(0.7 * 0.02)
    robot.driven(1000)
    assert robot.forward_mps == pytest.approx(0.2)
    assert robot.command(held=False).output == ZERO


def test_a_configured_ramp_follows_a_release_and_nothing_else() -> None:
    robot = Robot(Rules(release_ramp_s=0.2)).driving()
    robot.driven(1000)
    robot.command(held=False)
    robot.now_ns += 100 * MS
    robot.command(held=False)
    assert robot.forward_mps == pytest.approx(0.1)
    robot.now_ns += 100 * MS
    assert robot.command(held=False).output == ZERO
    robot = Robot(Rules(release_ramp_s=0.2)).driving()
    robot.driven(1000)
    assert robot.feed(Stop("ben")).output == ZERO


def test_a_ramp_ends_when_another_driver_gets_the_lease() -> None:
    robot = Robot(Rules(release_ramp_s=0.2)).driving()
    robot.driven(1000)
    robot.command(held=False)
    robot.now_ns += 50 * MS
    robot.command(held=False)
    assert robot.forward_mps > 0
    assert robot.feed(GrantLease(OTHER)).output == ZERO
    assert robot.state.phase is Phase.STOPPING
    assert robot.after(20).output == ZERO


@pytest.mark.parametrize("ends", ["by itself", "by a command without motion"])
def test_an_older_tools_command_ends_without_a_ramp(ends: str) -> None:
    """Motion for 500 ms is promised, with the slowing down."""
    robot = Robot(Rules(release_ramp_s=0.5), streaming=False)
    robot.feed(GrantLease(robot.lease))
    robot.command(held=True, valid_until_ns=10**18)
    robot.after(500)
    assert robot.forward_mps > 0
    if ends == "by itself":
        robot.after(1)
    else:
        robot.command(held=False)
    assert robot.state.phase is Phase.STOPPING
    assert robot.state.output == ZERO


def test_speed_follows_the_age_of_the_picture() -> None:
    robot = Robot().driving()
    robot.driven(1000)
    robot.now_ns += 20 * MS
    robot.command(held=True, picture_ns=robot.now_ns - 580 * MS)
    assert robot.forward_mps == pytest.approx(0.10 / 0.580)


def _tests_of_the_table() -> list[Callable[[], None]]:
    """The tests above that judge phases, ready to be called."""
    return [
        *(partial(test_every_pair_of_phase_and_event, phase, event) for phase in Phase for event in EVENTS),
        *(
            partial(test_every_pair_while_odometry_shows_motion, phase, event)
            for phase in Phase
            for event in sorted(EVENTS.keys() - {"robot's stop", "standstill"})
        ),
        *(partial(test_a_reset_ends_where_it_should, *rest) for rest in RESTS),
        partial(test_the_robot_is_handed_back_after_zeros, True, Phase.AVAILABLE),
        test_a_ramp_ends_when_another_driver_gets_the_lease,
        *(
            partial(test_the_zeros_for_others_start_again_with_the_end_of_the_lease, end)
            for end in (EndLease("s1", LeaseEnd.CLOSED), Enable(enabled=False))
        ),
    ]


SAME_BY_REST = {
    (Phase.DISABLED, Trigger.ENABLE): "driving is enabled, and no one can have the lease yet",
    (Phase.AVAILABLE, Trigger.DISABLE): "driving is disabled",
    (Phase.AVAILABLE, Trigger.LEASE): "there is a lease, and driving is enabled",
    (Phase.INHIBITED, Trigger.CLEAR): "there is a lease: CLEAR is said of its command",
}
"""Where REST is the phase that the table names, and why: no mutant."""


def _mutants() -> Iterator[tuple[Phase, Trigger, Phase | str | None]]:
    for phase, triggers in TRANSITIONS.items():
        for trigger, target in triggers.items():
            yield phase, trigger, "removed"
            for other in (*Phase, REST):
                if other is not target and not (other is REST and (phase, trigger) in SAME_BY_REST):
                    yield phase, trigger, other


@pytest.mark.parametrize(("phase", "trigger", "target"), list(_mutants()))
def test_every_mutant_of_the_table_is_noticed(
    monkeypatch: pytest.MonkeyPatch, phase: Phase, trigger: Trigger, target: Phase | str | None
) -> None:
    """A transition that is removed, or leads elsewhere, makes a test above fail."""
    changed = dict(TRANSITIONS[phase])
    if isinstance(target, str):
        del changed[trigger]
    else:
        changed[trigger] = target
    monkeypatch.setattr("drive.motion.machine.TRANSITIONS", {**TRANSITIONS, phase: changed})
    assert any(_fails(test) for test in _tests_of_the_table())


def test_the_table_itself_is_no_mutant() -> None:
    assert not any(_fails(test) for test in _tests_of_the_table())


def _fails(test: Callable[[], None]) -> bool:
    try:
        test()
    except AssertionError:
        return True
    return False


def _from(now_ns: int, offsets_ns: dict[str, int]) -> dict[str, Any]:
    return {name: now_ns + offset_ns for name, offset_ns in offsets_ns.items()}
