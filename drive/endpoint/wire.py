"""Schema of the socket between the gateway and the drive program (omniseer.drive.v1), on this side."""

from collections.abc import Callable, Iterator, Mapping
from typing import Final

from google.protobuf.message import DecodeError

from drive.motion.episode import Episode
from drive.motion.machine import (
    Enable,
    EndLease,
    Event,
    GrantLease,
    Reset,
    Rules,
    State,
    Stop,
    reset_obstacle,
)
from drive.motion.phases import RESTING, Phase
from drive.motion.shaping import supervised_limit_mps, supervised_limit_rad_s
from drive.motion.values import ZERO, Command, Inhibit, Latch, Lease, LeaseEnd, Supervision, Velocity
from omniseer.drive.v1 import drive_pb2 as pb

MAX_MESSAGE_BYTES: Final = 16 * 1024
"""Every message is smaller by far; a packet that is not is cut off and fails to decode."""

_MAX_NAME: Final = 128
_MAX_TEXT: Final = 512
"""Characters kept of what callers write: every report must fit into one packet."""
_MOST_PROBLEMS: Final = 4 * 1024
_MOST_OBSTACLE: Final = 2 * 1024
"""Bytes of what the graph makes longer: names of nodes and topics, as many as there are."""

PHASES: Final = {phase: pb.Phase.Value(f"PHASE_{phase.name}") for phase in Phase}
RESTING_PHASES: Final = frozenset(PHASES[phase] for phase in RESTING)
INHIBITS: Final = {inhibit: pb.Inhibit.Value(f"INHIBIT_{inhibit.name}") for inhibit in Inhibit}
_LEASE_ENDS: Final = {pb.LeaseEnd.Value(f"LEASE_END_{end.name}"): end for end in LeaseEnd}


class ProtocolError(Exception):
    """A packet that is not a message of this protocol."""


def decoded(packet: bytes) -> pb.ToDrive:
    """Returns the message of a packet.

    Raises:
        ProtocolError: it is none.
    """
    try:
        message = pb.ToDrive.FromString(packet)
    except DecodeError as error:
        raise ProtocolError(str(error)) from error
    if message.WhichOneof("message") is None:
        raise ProtocolError("the message is empty, or of a kind that this version does not know")
    return message


def event_of(message: pb.ToDrive) -> Event | None:
    """Returns the event that a message of the gateway is; None for those that are none by themselves."""
    kind = message.WhichOneof("message")
    return _EVENTS[kind](message) if kind is not None and kind in _EVENTS else None


def _lease(message: pb.GrantLease) -> Lease:
    supervision = Supervision.LINE_OF_SIGHT if message.line_of_sight else Supervision.PICTURE
    return Lease(message.session_id[:_MAX_NAME], message.holder[:_MAX_NAME], supervision, message.streaming)


def _command(message: pb.Command) -> Command:
    return Command(
        session_id=message.session_id[:_MAX_NAME],
        sequence=message.sequence,
        held=message.held,
        velocity=Velocity(message.vx_mps, message.vy_mps, message.wz_rad_s),
        valid_until_ns=message.valid_until_ns,
        echo_ns=message.echo_ns,
        picture_ns=message.picture_ns,
    )


_EVENTS: Final[Mapping[str, Callable[[pb.ToDrive], Event]]] = {
    "desired": lambda message: Enable(enabled=message.desired.enabled),
    "grant": lambda message: GrantLease(_lease(message.grant)),
    "end": lambda message: EndLease(
        message.end.session_id[:_MAX_NAME], _LEASE_ENDS.get(message.end.why, LeaseEnd.LOST)
    ),
    "command": lambda message: _command(message.command),
    "stop": lambda message: Stop(message.stop.by[:_MAX_NAME], message.stop.reason[:_MAX_TEXT]),
    "reset": lambda message: Reset(message.reset.stop_id),
}


def welcome(instance_id: str, rules: Rules, base_timeout_ms: int | None = None) -> pb.FromDrive:
    """Returns the answer to hello.

    Args:
        instance_id: names the process.
        rules: of the machine.
        base_timeout_ms: silence after which the base stops by itself; None if it is not known.
    """
    limits = rules.limits
    return pb.FromDrive(
        welcome=pb.Welcome(
            instance_id=instance_id,
            limits=pb.Limits(
                max_vx_mps=limits.vx_mps,
                max_vy_mps=limits.vy_mps,
                max_wz_rad_s=limits.wz_rad_s,
                acceleration_mps2=limits.acceleration_mps2,
                acceleration_rad_s2=limits.acceleration_rad_s2,
                max_picture_age_ms=rules.deadlines.picture_ns // 1_000_000,
                picture_travel_m=limits.picture_travel_m,
                line_of_sight_mps=limits.line_of_sight_mps,
                line_of_sight_rad_s=limits.line_of_sight_rad_s,
            ),
            base_timeout_ms=base_timeout_ms,
        )
    )


def episode_of(message: pb.ActualState) -> Episode | None:
    """Returns the newest time of motion that a worker has reported."""
    if not message.HasField("episode"):
        return None
    episode = message.episode
    return Episode(
        episode_id=episode.episode_id,
        holder=episode.holder,
        started_ns=episode.started_ns,
        ended_ns=episode.ended_ns,
        distance_m=episode.distance_m,
        turned_rad=episode.turned_rad,
        ended_by=episode.ended_by,
        recorded=episode.recorded,
    )


def actual_state(
    state: State,
    rules: Rules,
    now_ns: int,
    *,
    revision: int,
    counters: pb.Counters,
    episode: Episode | None,
    problems: list[str],
) -> pb.ActualState:
    """Returns the report of a state.

    Args:
        state: of the machine.
        rules: of the machine.
        now_ns: the instant.
        revision: newest desired state applied.
        counters: since the process started.
        episode: the newest.
        problems: for people.
    """
    command, output = state.command, state.output or ZERO
    message = pb.ActualState(
        monotonic_ns=now_ns,
        applied_revision=revision,
        phase=PHASES[state.phase],
        inhibits=sorted(INHIBITS[inhibit] for inhibit in state.inhibits),
        session_id=state.lease.session_id if state.lease else "",
        vx_mps=output.vx_mps,
        vy_mps=output.vy_mps,
        wz_rad_s=output.wz_rad_s,
        speed_limit_mps=_speed_limit_mps(state, rules, now_ns),
        turn_limit_rad_s=_turn_limit_rad_s(state, rules, now_ns),
        counters=counters,
        problems=_fitting(problems),
        reset_obstacle=_cut(reset_obstacle(state, now_ns), _MOST_OBSTACLE) if state.latch else "",
        enabled=state.enabled,
    )
    if command:
        message.newest_sequence, message.command_ns = command.sequence, state.command_ns
    _add_what_is_kept(message, state, episode)
    return message


def _fitting(problems: list[str]) -> Iterator[str]:
    """Yields the problems as far as they fit into a report, the last one cut off."""
    left = _MOST_PROBLEMS
    for problem in problems:
        kept = _cut(problem, left)
        left -= len(kept.encode())
        if kept:
            yield kept


def _cut(text: str, most_bytes: int) -> str:
    """Returns as much of a text as fits, with an ellipsis where that is not all of it."""
    encoded = text.encode()
    if len(encoded) <= most_bytes:
        return text
    kept = encoded[: max(0, most_bytes - len("..."))].decode(errors="ignore")
    return f"{kept}..." if kept else ""


def heartbeat(state: State, episode: Episode | None, matched: int, *, lock_left: bool) -> pb.ActualState:
    """Returns what the guard needs of the report of a state: it comes 50 times a second.

    Args:
        state: of the machine.
        episode: the newest.
        matched: how many subscriptions take the velocities.
        lock_left: whether the lock was published, and is not known to be released since.
    """
    message = pb.ActualState(phase=PHASES[state.phase], matched=matched, lock_left=lock_left)
    _add_what_is_kept(message, state, episode)
    return message


def _add_what_is_kept(message: pb.ActualState, state: State, episode: Episode | None) -> None:
    """Adds what outlives the process: the stop, and the newest time of motion."""
    if state.latch:
        message.stop.CopyFrom(_latch_message(state.latch, state.since_ns))
    if episode:
        message.episode.CopyFrom(_episode_message(episode))


def _speed_limit_mps(state: State, rules: Rules, now_ns: int) -> float:
    """Returns the largest speed that the driver's way of seeing permits now."""
    if state.lease is None:
        return 0.0
    return supervised_limit_mps(state.lease.supervision, _picture_age_s(state, now_ns), rules.limits)


def _turn_limit_rad_s(state: State, rules: Rules, now_ns: int) -> float:
    """Returns the largest turning rate that the driver's way of seeing permits now."""
    if state.lease is None:
        return 0.0
    return supervised_limit_rad_s(state.lease.supervision, _picture_age_s(state, now_ns), rules.limits)


def _picture_age_s(state: State, now_ns: int) -> float:
    return (now_ns - (state.command.picture_ns if state.command else 0)) / 1e9


def _latch_message(latch: Latch, since_ns: int) -> pb.Latch:
    """Returns the message of a stop."""
    return pb.Latch(stop_id=latch.stop_id, by=latch.by, reason=latch.reason, since_ns=since_ns)


def _episode_message(episode: Episode) -> pb.Episode:
    return pb.Episode(
        episode_id=episode.episode_id,
        holder=episode.holder,
        started_ns=episode.started_ns,
        ended_ns=episode.ended_ns,
        distance_m=episode.distance_m,
        turned_rad=episode.turned_rad,
        ended_by=episode.ended_by,
        recorded=episode.recorded,
    )
