"""The robot at a glance, for the fleet's table: what it is, and when it is sent. Pure."""

import math
from dataclasses import dataclass
from typing import Final

from bridge.connection.configured_values import add_values, without_measurements
from bridge.events.values import INFO
from omniseer.fleet.v1 import state_pb2 as pb
from omniseer.fleet.v1.upload_pb2 import UploadBrief
from omniseer.gateway.v1 import fault_pb2
from omniseer.gateway.v1.platform_pb2 import PlatformStatus
from omniseer.gateway.v1.system_status_pb2 import SystemStatus

MIN_INTERVAL_S: Final = 1.0
KEEPALIVE_S: Final = 10.0
MOST_FAULTS: Final = 8
MOST_UPLOADS: Final = 4
_MESSAGE_CHARACTERS: Final = 200
_S_PER_MIN: Final = 60
_MS_PER_S: Final = 1000


@dataclass(frozen=True, slots=True)
class Own:
    """What the bridge knows by itself.

    Attributes:
        uploads: those that run or wait, in their order.
    """

    robot: str
    bridge_version: str
    gateway_target: str
    gateway_reachable: bool
    outbox_events: int
    events_dropped: int
    uploads: tuple[UploadBrief, ...] = ()


def robot_state(own: Own, status: SystemStatus | None) -> pb.RobotState:
    """Returns the state, rounded so that it changes rarely.

    Args:
        own: what the bridge knows.
        status: the newest one of the gateway; None before the first.
    """
    state = pb.RobotState(
        robot=own.robot,
        bridge_version=own.bridge_version,
        gateway_target=own.gateway_target,
        gateway_reachable=own.gateway_reachable,
        outbox_events=own.outbox_events,
        events_dropped=own.events_dropped,
        uploads=own.uploads[:MOST_UPLOADS],
        upload_count=len(own.uploads),
    )
    if status is not None:
        _add_status(state, status)
    return state


def is_charging(status: SystemStatus | None) -> bool | None:
    """Returns whether the main battery is being charged; None if that is not known, or not any more."""
    if status is None:
        return None
    battery = status.platform.power.lipo_battery
    known = battery.available and battery.charging_available and not battery.stale
    return battery.charging if known else None


def same_but_for_time(state: pb.RobotState) -> bytes:
    """Returns what two states have in common if nothing has happened between them.

    Time and what is measured change by themselves: they come with the next state, after 10 s at the latest.
    """
    key = pb.RobotState()
    key.CopyFrom(state)
    key.ClearField("gateway_uptime_s")
    without_measurements(key)
    return key.SerializeToString(deterministic=True)


def due_in_s(*, changed: bool, since_sent_s: float) -> float:
    """Returns how long the next state has to wait, in seconds; not positive: send it now."""
    return (MIN_INTERVAL_S if changed else KEEPALIVE_S) - since_sent_s


def _add_status(state: pb.RobotState, status: SystemStatus) -> None:
    state.gateway_name = status.gateway_name[:_MESSAGE_CHARACTERS]
    state.gateway_version = status.gateway_version[:_MESSAGE_CHARACTERS]
    state.gateway_run_id = status.gateway.run_id[:_MESSAGE_CHARACTERS]
    state.gateway_uptime_s = status.gateway.uptime_ms // _MS_PER_S // _S_PER_MIN * _S_PER_MIN
    state.ready = status.health.ready
    state.health = status.health.state
    state.summary = status.health.summary[:_MESSAGE_CHARACTERS]
    if status.mission.available:
        state.mode = status.mission.mode[:_MESSAGE_CHARACTERS]
    # The gateway lists active ones first, the most severe of them before the others.
    active = sorted(
        (each for each in status.faults if each.active),
        key=lambda each: (-max(each.severity, INFO), -each.age_ms, each.id),
    )
    state.fault_count = len(active)
    state.faults.extend(_brief(each) for each in active[:MOST_FAULTS])
    state.preview = status.preview.state
    state.drive = status.teleop.phase
    state.recorder = status.recording.state
    state.recordings_to_copy = status.recording.to_copy
    if (charging := is_charging(status)) is not None:
        state.charging = charging
    _add_platform(state, status.platform)
    add_values(state, status)


def _add_platform(state: pb.RobotState, platform: PlatformStatus) -> None:
    battery, compute = platform.power.lipo_battery, platform.compute
    if battery.available and battery.percentage_available and not battery.stale:
        state.battery_percent = _percent(battery.percentage)
    if compute.disk_available and not compute.stale:
        state.disk_used_percent = _percent(compute.disk_used_percent)


def _brief(fault: fault_pb2.Fault) -> pb.FaultBrief:
    message = fault.message[:_MESSAGE_CHARACTERS]
    return pb.FaultBrief(fault_id=fault.id, severity=fault.severity, message=message)


def _percent(value: float) -> int:
    return 0 if math.isnan(value) else round(min(max(value, 0.0), 100.0))
