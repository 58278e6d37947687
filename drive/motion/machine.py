"""The whole decision about motion: state, event and instant give the next state. Pure.

The worker feeds in what happens and publishes `State.output`. Nothing else may move the robot.
"""

from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Final

from drive.motion.inhibits import Deadlines, inhibits
from drive.motion.phases import TRANSITIONS, Phase, Trigger
from drive.motion.shaping import Limits, approached, limited, ramped_down, supervised
from drive.motion.values import (
    MS,
    ZERO,
    Command,
    Inhibit,
    Latch,
    Lease,
    LeaseEnd,
    Surroundings,
    Velocity,
)

_STANDSTILL_NS: Final = 1000 * MS
"""STOPPING ends after this long at the latest, with a lease."""
_HAND_BACK_NS: Final = 500 * MS
"""Zeros follow a lease for this long: the usual timeout of twist_mux, after which others have the robot."""
_LOCK_AFTER_NS: Final = 300 * MS
"""The lock follows the zeros of a stop, which it would mask: twist_mux forwards nothing while locked."""


class OnLoss(Enum):
    """What becomes of the robot when its driver is lost while driving."""

    HOLD = "hold"
    """It stays stopped until a person resets the stop."""
    HAND_BACK = "hand_back"
    """Other sources of commands have it again, after zeros."""


@dataclass(frozen=True, slots=True)
class Rules:
    """The configuration of the machine.

    Attributes:
        release_ramp_s: duration of the slowing down after the driver of a stream has released; 0 for none.
    """

    limits: Limits = field(default_factory=Limits)
    deadlines: Deadlines = field(default_factory=Deadlines)
    on_loss: OnLoss = OnLoss.HOLD
    release_ramp_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Enable:
    """Driving is enabled or disabled."""

    enabled: bool


@dataclass(frozen=True, slots=True)
class GrantLease:
    """A session may drive, in place of any other."""

    lease: Lease


@dataclass(frozen=True, slots=True)
class EndLease:
    """The lease of a session has ended."""

    session_id: str
    why: LeaseEnd


@dataclass(frozen=True, slots=True)
class Stop:
    """The robot is to be stopped, by whom and why, for people. Each stop has a number of its own."""

    by: str
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Reset:
    """The stop of this number is to be reset."""

    stop_id: int


@dataclass(frozen=True, slots=True)
class Observe:
    """The surroundings have been observed."""

    surroundings: Surroundings


@dataclass(frozen=True, slots=True)
class Tick:
    """Time has passed."""


Event = Enable | GrantLease | EndLease | Command | Stop | Reset | Observe | Tick


@dataclass(frozen=True, slots=True)
class State:
    """Everything that decides about motion.

    Attributes:
        enabled: whether driving is enabled at all.
        command: newest of the present lease.
        command_ns: when it arrived.
        since_ns: when the phase began.
        inhibits: why a driver must not move the robot; its own reasons also without a driver.
        output: what is to be published; None for nothing.
        output_ns: when `output` was computed.
        released_at: output at the release that STOPPING slows down from; ZERO for an immediate stop.
        latch: the stop, in STOPPED.
        last_stop_id: of the newest stop.
        ignored: commands that were not the holder's, not finite, or not newer than the last.
    """

    phase: Phase = Phase.DISABLED
    enabled: bool = False
    lease: Lease | None = None
    command: Command | None = None
    command_ns: int = 0
    surroundings: Surroundings = field(default_factory=Surroundings)
    inhibits: frozenset[Inhibit] = frozenset()
    since_ns: int = 0
    output: Velocity | None = None
    output_ns: int = 0
    released_at: Velocity = ZERO
    latch: Latch | None = None
    last_stop_id: int = 0
    ignored: int = 0

    @classmethod
    def at_start(
        cls, now_ns: int = 0, *, enabled: bool, latch: Latch | None = None, last_stop_id: int = 0
    ) -> "State":
        """Returns the state of a new process; a stop and the numbers of stops outlive the process."""
        if latch:
            phase, last_stop_id = Phase.STOPPED, max(last_stop_id, latch.stop_id)
        else:
            phase = Phase.AVAILABLE if enabled else Phase.DISABLED
        return cls(phase=phase, enabled=enabled, since_ns=now_ns, latch=latch, last_stop_id=last_stop_id)

    @property
    def held_last(self) -> bool:
        """Whether the driver of a stream held when last heard of."""
        return bool(self.lease and self.lease.streaming and self.command and self.command.held)

    def valid_command(self, now_ns: int) -> Command | None:
        """Returns the newest command of the lease while it is valid; None before the first and after it."""
        command = self.command
        return command if command is not None and now_ns <= command.valid_until_ns else None

    def holding(self, now_ns: int) -> bool:
        """Whether the driver holds, by a command that is still valid."""
        command = self.valid_command(now_ns)
        return command is not None and command.held

    def heard(self, now_ns: int) -> bool:
        """Whether the driver of a stream is there: the newest command is still valid.

        A lease alone proves no driver. It outlives the driver's program by up to 2 s, and that of a tool
        without a stream outlives its only command.
        """
        streaming = self.lease is not None and self.lease.streaming
        return streaming and self.valid_command(now_ns) is not None

    @property
    def expires_ns(self) -> int | None:
        """When motion ends for want of a newer command; None while nothing moves."""
        if self.phase is not Phase.DRIVING or self.command is None:
            return None
        return self.command.valid_until_ns + 1

    def locked(self, now_ns: int) -> bool:
        """Whether the robot's lock is to be active."""
        return self.phase is Phase.STOPPED and now_ns - self.since_ns >= _LOCK_AFTER_NS


def step(state: State, event: Event, now_ns: int, rules: Rules) -> State:
    """Returns the state after an event.

    Args:
        state: before it.
        event: what has happened.
        now_ns: the instant; never earlier than that of the last step.
        rules: as configured.
    """
    before = state
    state, trigger = _taken(before, event, now_ns, rules)
    reasons = inhibits(
        state.lease,
        state.command,
        state.surroundings,
        now_ns,
        rules.deadlines,
        publishing=before.output is not None,
    )
    if reasons != state.inhibits:
        state = replace(state, inhibits=reasons)
    if trigger:
        state = _moved(state, trigger, now_ns)
    for condition in _conditions(before, state, now_ns):
        state = _moved(state, condition, now_ns)
    if _settled(state, now_ns, rules):
        state = _moved(state, Trigger.SETTLED, now_ns)
    return replace(state, output=_output(state, now_ns, rules), output_ns=now_ns)


def reset_obstacle(state: State, now_ns: int) -> str:
    """Returns what keeps the stop from being reset, for people; empty if nothing does.

    A reset never moves the robot: not by its driver's hold, and not by leaving it to a source that has gone
    on publishing. While a driver is heard, zeros keep sources of lower priority away.
    """
    surroundings, masked = state.surroundings, state.heard(now_ns)
    if state.holding(now_ns):
        return "the driver holds: release first"
    if surroundings.commanded_on and not masked:
        topics = ", ".join(surroundings.commanded_on)
        return (
            f"another source commands motion on {topics}, and would move the robot: "
            "end that first, or begin to drive, which keeps it away, and reset the stop then"
        )
    if surroundings.outranked:
        return "another source moves the robot: end that first"
    if not surroundings.sources_known and not masked:
        return (
            "it is not known yet what else commands the robot, so soon after the start or after another "
            "source has moved it: try again in 3 s"
        )
    return ""


def _taken(state: State, event: Event, now_ns: int, rules: Rules) -> tuple[State, Trigger | None]:
    """Returns the state with what the event says, and the trigger that it is."""
    match event:
        case Enable():
            return _enabled(state, event)
        case GrantLease(lease) if state.enabled:
            return replace(state, lease=lease, command=None), Trigger.LEASE
        case EndLease(session_id, why) if state.lease and state.lease.session_id == session_id:
            return _lease_ended(state, why, now_ns, rules)
        case Stop(by, reason):
            return _latched(state, by, reason), Trigger.STOP
        case Reset(stop_id) if (
            state.latch and state.latch.stop_id == stop_id and not reset_obstacle(state, now_ns)
        ):
            return replace(state, latch=None, command=None), Trigger.RESET
        case _:
            return _informed(state, event, now_ns, rules.deadlines), None


def _informed(state: State, event: Event, now_ns: int, deadlines: Deadlines) -> State:
    match event:
        case Command():
            return _commanded(state, event, now_ns, deadlines)
        case Observe(surroundings):
            return replace(state, surroundings=surroundings)
        case _:
            return state


def _enabled(state: State, event: Enable) -> tuple[State, Trigger]:
    if event.enabled:
        return replace(state, enabled=True), Trigger.ENABLE
    return replace(state, enabled=False, lease=None, command=None), Trigger.DISABLE


def _lease_ended(state: State, why: LeaseEnd, now_ns: int, rules: Rules) -> tuple[State, Trigger]:
    """Ends the lease. A driver lost while holding leaves a robot that a person has to look after.

    A stop that is latched already keeps its number and its reason: there was no motion to lose.
    """
    lease, held = state.lease, _held_last(state, now_ns)
    state = replace(state, lease=None, command=None)
    if state.latch:
        return state, Trigger.LEASE_ENDED
    if lease and held and why in {LeaseEnd.LOST, LeaseEnd.ACCESS_ENDED} and rules.on_loss is OnLoss.HOLD:
        return _latched(state, lease.holder, f"the driver was lost while driving: {why.value}"), Trigger.STOP
    return state, Trigger.LEASE_ENDED


def _held_last(state: State, now_ns: int) -> bool:
    """Whether the driver held when last heard of. Without a stream the end of the validity is a release."""
    return state.held_last if state.lease and state.lease.streaming else state.holding(now_ns)


def _latched(state: State, by: str, reason: str) -> State:
    """Returns the state with a stop that has a number of its own, also where the same caller has stopped it.

    Two people may share a credential: a reset that is on its way must not undo a stop that it has not seen.
    """
    stop_id = state.last_stop_id + 1
    return replace(state, latch=Latch(stop_id, by, reason), last_stop_id=stop_id)


def _commanded(state: State, command: Command, now_ns: int, deadlines: Deadlines) -> State:
    """Takes a command of the holder newer than the last, and bounds its validity from its arrival on."""
    lease, last = state.lease, state.command
    newer = last is None or command.sequence > last.sequence
    if not lease or lease.session_id != command.session_id or not newer or not command.velocity.is_finite:
        return replace(state, ignored=state.ignored + 1)
    longest_ns = deadlines.command_ns if lease.streaming else deadlines.unary_ns
    command = replace(
        command,
        valid_until_ns=min(command.valid_until_ns, now_ns + longest_ns),
        # An echo of an instant that has not been is no echo.
        echo_ns=command.echo_ns if command.echo_ns <= now_ns else 0,
    )
    return replace(state, command=command, command_ns=now_ns)


def _conditions(before: State, state: State, now_ns: int) -> tuple[Trigger, ...]:
    """Returns what holds at this instant, whatever the event was."""
    if state.inhibits and state.lease:
        # Without a driver they are only known: there is no motion to end, and no release that they wait for.
        return (Trigger.INHIBIT,)
    if state.command is None:
        return ()  # Nothing is known of the driver's hands.
    if state.holding(now_ns):
        return (Trigger.HOLD,) if _pressed(before, state, now_ns) else ()
    return (Trigger.CLEAR, Trigger.RELEASE)


def _pressed(before: State, state: State, now_ns: int) -> bool:
    """Whether this very command begins a hold: the one before it was not held.

    A hold never begins with the first command of a session, nor goes on after an inhibit or a stop.
    """
    if state.command is before.command or state.lease is None:
        return False
    if state.lease.streaming:
        return before.command is not None and not before.command.held
    return not before.holding(now_ns)


def _settled(state: State, now_ns: int, rules: Rules) -> bool:
    """Whether STOPPING has lasted long enough: until the robot stands still, or others may have it."""
    elapsed_ns = now_ns - state.since_ns
    if state.lease is None:
        return elapsed_ns >= _HAND_BACK_NS
    slowed_down = elapsed_ns >= rules.release_ramp_s * 1e9
    return slowed_down and (state.surroundings.still is True or elapsed_ns >= _STANDSTILL_NS)


def _moved(state: State, trigger: Trigger, now_ns: int) -> State:
    """Returns the state in the phase that the table gives; the same state if it gives none."""
    if trigger not in TRANSITIONS[state.phase]:
        return state
    phase = TRANSITIONS[state.phase][trigger] or _rest(state)
    # Without a stream the end of a command is its release, and motion ends with it.
    slows_down = trigger is Trigger.RELEASE and state.heard(now_ns)
    released_at = state.output or ZERO if slows_down else ZERO
    return replace(state, phase=phase, since_ns=now_ns, released_at=released_at)


def _rest(state: State) -> Phase:
    if not state.enabled:
        return Phase.DISABLED
    return Phase.ARMED if state.lease else Phase.AVAILABLE


def _output(state: State, now_ns: int, rules: Rules) -> Velocity | None:
    """Returns what is to be published."""
    match state.phase:
        case Phase.DISABLED | Phase.AVAILABLE:
            return None
        case Phase.DRIVING if state.lease and state.command:
            age_s = (now_ns - state.command.picture_ns) / 1e9
            wanted = limited(state.command.velocity, rules.limits)
            wanted = supervised(wanted, state.lease.supervision, age_s, rules.limits)
            elapsed_s = (now_ns - max(state.output_ns, state.since_ns)) / 1e9
            return approached(state.output or ZERO, wanted, elapsed_s, rules.limits)
        case Phase.STOPPING if state.lease:
            return ramped_down(state.released_at, (now_ns - state.since_ns) / 1e9, rules.release_ramp_s)
        case _:
            return ZERO
