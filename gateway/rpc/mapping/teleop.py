"""Driving as messages of the contract."""

from typing import Final

from gateway.links.drive.state import DriveCommand
from gateway.rpc.mapping.enums import DRIVE_INHIBITS, DRIVE_PHASES, TELEOP_STATES
from gateway.status.freshness import age_ms
from gateway.status.teleop import DriveLimits, StopLatch, TeleopView
from gateway.status.values import Velocity
from gateway.teleop.lane import DriveFacts
from gateway.teleop.lease import MAX_LANES
from omniseer.gateway.v1 import system_status_pb2
from omniseer.gateway.v1 import teleop_pb2 as pb

COMMAND_STALE_AFTER_MS: Final = 500
"""The usual timeout of twist_mux, after which a command has no effect."""
_NS_PER_MS: Final = 1_000_000
_LONGEST_AGE_MS: Final = 2**32 - 1
"""The schema's uint32. Drivers choose the instants of echo and picture, and a robot may be up for longer."""


def teleop_status(view: TeleopView, now_s: float) -> system_status_pb2.TeleopStatus:
    """Returns driving as part of the status of `now_s` (monotonic seconds)."""
    drive, actual = view.drive, view.drive.actual
    status = system_status_pb2.TeleopStatus(
        state=TELEOP_STATES[drive.enabled and drive.reachable],
        enabled=drive.enabled and drive.reachable,
        max_linear_mps=actual.limits.max_vx_mps if actual else 0.0,
        max_angular_rad_s=actual.limits.max_wz_rad_s if actual else 0.0,
        last_error=view.last_error,
        phase=DRIVE_PHASES[drive.phase],
        inhibits=[DRIVE_INHIBITS[each] for each in view.inhibits],
        holder=view.holder,
        base_timeout_ms=actual.base_timeout_ms if actual else None,
    )
    if view.command:
        velocity, age = view.command.value, age_ms(view.command.at_s, now_s)
        status.last_command_available = True
        status.last_command_age_ms = age
        status.last_command_stale = age > COMMAND_STALE_AFTER_MS
        status.last_command_vx_mps = velocity.vx_mps
        status.last_command_vy_mps = velocity.vy_mps
        status.last_command_wz_rad_s = velocity.wz_rad_s
    if drive.stop:
        status.stop.CopyFrom(stop_latch(drive.stop, int(now_s * 1e9)))
    return status


def stop_latch(stop: StopLatch, now_ns: int) -> pb.StopLatch:
    """Returns a stop, at an instant."""
    age_ms = max(0, now_ns - stop.since_ns) // _NS_PER_MS
    return pb.StopLatch(stop_id=stop.stop_id, by=stop.by, reason=stop.reason, age_ms=age_ms)


def opened(
    session_id: str, run_id: str, limits: DriveLimits | None, *, line_of_sight: bool
) -> pb.DriveResponse:
    """Returns the first message on a lane.

    Args:
        session_id: names the session.
        run_id: names the run of the gateway.
        limits: what the robot accepts.
        line_of_sight: whether driving without a picture is permitted.
    """
    message = pb.DriveResponse(
        opened=pb.DriveOpened(session_id=session_id, run_id=run_id, max_lanes=MAX_LANES)
    )
    if limits:
        values = {name: getattr(limits, name) for name in DriveLimits.__slots__}
        message.opened.limits.CopyFrom(pb.DriveLimits(**values, line_of_sight=line_of_sight))
    return message


def drive_state(facts: DriveFacts) -> pb.DriveResponse:
    """Returns the state for one driver."""
    actual = facts.drive.actual if facts.drive.reachable else None
    state = pb.DriveState(
        monotonic_ns=facts.now_ns,
        newest_sequence=facts.newest_sequence,
        phase=DRIVE_PHASES[facts.phase],
        inhibits=[DRIVE_INHIBITS[each] for each in facts.inhibits],
        command_age_ms=min(facts.command_age_ms, _LONGEST_AGE_MS),
        loop_age_ms=min(facts.loop_age_ms, _LONGEST_AGE_MS),
    )
    if facts.picture_age_ms is not None:
        state.picture_age_ms = min(facts.picture_age_ms, _LONGEST_AGE_MS)
    if actual:
        velocity = actual.velocity
        state.vx_mps, state.vy_mps, state.wz_rad_s = velocity.vx_mps, velocity.vy_mps, velocity.wz_rad_s
        # A picture of this instant would permit any speed.
        state.speed_limit_mps = min(actual.speed_limit_mps, actual.limits.max_vx_mps)
        if actual.turn_limit_rad_s is not None:
            state.turn_limit_rad_s = min(actual.turn_limit_rad_s, actual.limits.max_wz_rad_s)
        state.problems.extend(actual.problems)
    # Also of a robot that does not answer: the driver needs the number to reset the stop.
    if stop := facts.drive.stop:
        state.stop.CopyFrom(stop_latch(stop, facts.now_ns))
    return pb.DriveResponse(state=state)


def command_from(message: pb.DriveCommand) -> DriveCommand:
    """Returns a driver's command."""
    return DriveCommand(
        sequence=message.sequence,
        held=message.held,
        velocity=Velocity(message.vx_mps, message.vy_mps, message.wz_rad_s),
        valid_until_ns=message.valid_until_monotonic_ns,
        echo_ns=message.echo_monotonic_ns,
        picture_ns=message.picture_monotonic_ns,
    )
