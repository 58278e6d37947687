"""What the practice robot takes and answers, between the operators' contract and the drive core's values."""

import time
from dataclasses import dataclass
from typing import Final

from common.version import project_version
from console.client import results
from console.client.drive_lanes import LANES
from console.client.mapping.reader import read
from drive.motion.machine import Rules, State
from drive.motion.values import MS, ZERO, Command, Lease, Supervision, Velocity
from omniseer.gateway.v1 import overlay_pb2, preview_pb2, system_status_pb2, teleop_pb2
from omniseer.gateway.v1 import states_pb2 as states
from practice.robot import PracticeRobot
from simrobot.base import TIMEOUT_S

NAME: Final = "PRACTICE"
DRIVER: Final = "this window"


@dataclass(frozen=True, slots=True)
class Opening:
    """The first request of a lane: a lease for a new session, or None to join the present one."""

    lease: Lease | None


def request(packet: bytes, session_id: str) -> Opening | Command:
    """Returns what a lane's request asks for.

    Args:
        packet: of this project's own client.
        session_id: of the session, or of one that it opens.
    """
    message = teleop_pb2.DriveRequest.FromString(packet)
    if message.HasField("open"):
        by_eye = message.open.supervision == teleop_pb2.SUPERVISION_LINE_OF_SIGHT
        supervision = Supervision.LINE_OF_SIGHT if by_eye else Supervision.PICTURE
        return Opening(None if message.open.session_id else Lease(session_id, DRIVER, supervision))
    command = message.command
    return Command(
        session_id,
        command.sequence,
        command.held,
        Velocity(command.vx_mps, command.vy_mps, command.wz_rad_s),
        command.valid_until_monotonic_ns,
        command.echo_monotonic_ns,
        command.picture_monotonic_ns,
    )


def opened(session_id: str, rules: Rules) -> results.DriveOpened:
    """Returns the answer to an opening."""
    limits = rules.limits
    return results.DriveOpened(
        session_id=session_id,
        run_id=NAME,
        max_lanes=LANES,
        limits=results.DriveLimits(
            max_vx_mps=limits.vx_mps,
            max_vy_mps=limits.vy_mps,
            max_wz_rad_s=limits.wz_rad_s,
            acceleration_mps2=limits.acceleration_mps2,
            acceleration_rad_s2=limits.acceleration_rad_s2,
            max_picture_age_ms=rules.deadlines.picture_ns // MS,
            picture_travel_m=limits.picture_travel_m,
            line_of_sight=True,
            line_of_sight_mps=limits.line_of_sight_mps,
            line_of_sight_rad_s=limits.line_of_sight_rad_s,
        ),
    )


def drive_state(robot: PracticeRobot, now_ns: int) -> results.DriveState:
    """Returns what a driver hears of the robot."""
    state, command, output = robot.state, robot.state.command, robot.state.output or ZERO
    return results.DriveState(
        monotonic_ns=now_ns,
        newest_sequence=command.sequence if command else 0,
        phase=phase(state),
        inhibits=_inhibits(state),
        vx_mps=output.vx_mps,
        vy_mps=output.vy_mps,
        wz_rad_s=output.wz_rad_s,
        command_age_ms=(now_ns - robot.state.command_ns) // MS if command else 0,
        loop_age_ms=(now_ns - command.echo_ns) // MS if command else 0,
        picture_age_ms=(now_ns - command.picture_ns) // MS if command and command.picture_ns else None,
        speed_limit_mps=robot.speed_limit_mps(now_ns),
        stop=stop(state, now_ns),
        problems=(),
        turn_limit_rad_s=robot.turn_limit_rad_s(now_ns),
    )


def phase(state: State) -> results.DrivePhase:
    """Returns the phase of driving."""
    return results.DrivePhase[state.phase.name]


def stop(state: State, now_ns: int) -> results.StopLatch | None:
    """Returns the stop in force; None without one."""
    latch = state.latch
    if latch is None:
        return None
    age_ms = (now_ns - state.since_ns) // MS
    return results.StopLatch(stop_id=latch.stop_id, by=latch.by, reason=latch.reason, age_ms=age_ms)


def robot_time(now_ns: int) -> results.RobotTime:
    """Returns the robot's clocks, which are this computer's."""
    return results.RobotTime(monotonic_ns=now_ns, wall_clock_unix_ns=time.time_ns(), boot_id=NAME)


def watched(robot: PracticeRobot, now_ns: int) -> results.WatchedStatus:
    """Returns the status of the whole robot, which has a base and a camera and detects nothing."""
    return results.WatchedStatus(
        status=_status(robot, now_ns),
        monotonic_ns=now_ns,
        detections=read(results.Detections, overlay_pb2.DetectionOverlayStatus()),
    )


def _status(robot: PracticeRobot, now_ns: int) -> results.SystemStatus:
    velocity, limits = robot.velocity(now_ns), robot.rules.limits
    message = system_status_pb2.SystemStatus(
        gateway_name=NAME,
        gateway_version=project_version(),
        health=system_status_pb2.RobotHealth(
            state=states.ROBOT_HEALTH_OK,
            ready=True,
            summary="practice: no robot moves",
            odom_available=True,
            linear_speed_mps=abs(velocity.vx_mps) + abs(velocity.vy_mps),
            angular_speed_rad_s=abs(velocity.wz_rad_s),
            measured_vx_mps=velocity.vx_mps,
            measured_vy_mps=velocity.vy_mps,
            measured_wz_rad_s=velocity.wz_rad_s,
        ),
        preview=preview_pb2.PreviewStatus(
            state=states.PREVIEW_RUNNING if robot.preview_on else states.PREVIEW_DISABLED,
            profile=preview_pb2.PREVIEW_PROFILE_BALANCED,
            service_reachable=True,
        ),
        teleop=_teleop(robot, now_ns, limits.vx_mps, limits.wz_rad_s),
    )
    if robot.preview_on:
        message.preview.endpoint.host, message.preview.endpoint.port = NAME, 1  # No one connects to it.
        message.preview.endpoint.transport = preview_pb2.STREAM_TRANSPORT_SRT
        message.preview.endpoint.container = preview_pb2.STREAM_CONTAINER_MPEG_TS
    return read(results.SystemStatus, message)


def _teleop(
    robot: PracticeRobot, now_ns: int, max_linear_mps: float, max_angular_rad_s: float
) -> system_status_pb2.TeleopStatus:
    state = robot.state
    message = system_status_pb2.TeleopStatus(
        state=states.TELEOP_ENABLED if state.enabled else states.TELEOP_DISABLED,
        enabled=state.enabled,
        max_linear_mps=max_linear_mps,
        max_angular_rad_s=max_angular_rad_s,
        phase=teleop_pb2.DrivePhase.Value(f"DRIVE_PHASE_{state.phase.name}"),
        inhibits=[teleop_pb2.DriveInhibit.Value(f"DRIVE_INHIBIT_{each.name}") for each in state.inhibits],
        holder=state.lease.holder if state.lease else "",
        base_timeout_ms=round(TIMEOUT_S * 1000),
    )
    if latch := stop(state, now_ns):
        message.stop.CopyFrom(
            teleop_pb2.StopLatch(stop_id=latch.stop_id, by=latch.by, reason=latch.reason, age_ms=latch.age_ms)
        )
    return message


def _inhibits(state: State) -> tuple[results.DriveInhibit, ...]:
    return tuple(sorted((results.DriveInhibit[each.name] for each in state.inhibits), key=lambda e: e.value))
