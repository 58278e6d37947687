"""The whole status with faults and sources, from the contract's messages."""

from console.client.mapping import enums
from console.client.mapping.info import gateway_facts
from console.client.mapping.platform import platform
from console.client.mapping.preview import preview
from console.client.mapping.values import number, number_when, sample, when
from console.client.results import (
    EffectiveCommand,
    Fault,
    Health,
    Mission,
    Odometry,
    Source,
    SystemStatus,
    Teleop,
    TeleopCommand,
    Vision,
)
from omniseer.gateway.v1 import fault_pb2, source_pb2
from omniseer.gateway.v1 import system_status_pb2 as wire


def system_status(message: wire.SystemStatus) -> SystemStatus:
    """Returns the status of the whole robot."""
    return SystemStatus(
        gateway_name=message.gateway_name,
        gateway_version=message.gateway_version,
        insecure=message.insecure,
        health=_health(message.health),
        odometry=_odometry(message.health),
        vision=_vision(message.vision),
        preview=preview(message.preview),
        platform=platform(message.platform),
        effective_command=_effective_command(message.effective_command),
        teleop=_teleop(message.teleop),
        faults=tuple(fault(each) for each in message.faults),
        mission=_mission(message.mission),
        sources=tuple(_source(each) for each in message.sources),
        gateway=gateway_facts(message.gateway, reported=message.HasField("gateway")),
    )


def fault(message: fault_pb2.Fault) -> Fault:
    """Returns one fault."""
    return Fault(
        id=message.id,
        severity=enums.fault_severity(message.severity),
        component=message.component,
        message=message.message,
        remedy=message.remedy,
        active=message.active,
        age_ms=message.age_ms,
        cleared_age_ms=when(message.HasField("cleared_age_ms"), message.cleared_age_ms),
        times_raised=message.times_raised,
    )


def _source(message: source_pb2.SourceStatus) -> Source:
    return Source(
        **sample(message),
        name=message.name,
        state=enums.source_state(message.state),
        required=message.required,
        detail=message.detail,
    )


def _health(message: wire.RobotHealth) -> Health:
    return Health(state=enums.health_state(message.state), ready=message.ready, summary=message.summary)


def _odometry(message: wire.RobotHealth) -> Odometry:
    here = message.odom_available
    return Odometry(
        available=here,
        stale=message.odom_stale,
        age_ms=when(here, message.odom_age_ms),
        linear_speed_mps=number_when(here, message.linear_speed_mps),
        angular_speed_rad_s=number_when(here, message.angular_speed_rad_s),
        vx_mps=number_when(here, message.measured_vx_mps),
        vy_mps=number_when(here, message.measured_vy_mps),
        wz_rad_s=number_when(here, message.measured_wz_rad_s),
    )


def _vision(message: wire.VisionStatus) -> Vision:
    here = message.available
    return Vision(
        **sample(message),
        producer_fps=number_when(here, message.producer_fps),
        consumer_fps=number_when(here, message.consumer_fps),
        last_infer_ms=number_when(here, message.last_infer_ms),
        infer_error_count=when(here, message.infer_error_count),
        capture_fatal_error_count=when(here, message.capture_fatal_error_count),
    )


def _teleop(message: wire.TeleopStatus) -> Teleop:
    here = message.last_command_available
    return Teleop(
        state=enums.teleop_state(message.state),
        enabled=message.enabled,
        max_linear_mps=number(message.max_linear_mps),
        max_angular_rad_s=number(message.max_angular_rad_s),
        last_error=message.last_error,
        last_command=TeleopCommand(
            available=here,
            stale=message.last_command_stale,
            age_ms=when(here, message.last_command_age_ms),
            vx_mps=number_when(here, message.last_command_vx_mps),
            vy_mps=number_when(here, message.last_command_vy_mps),
            wz_rad_s=number_when(here, message.last_command_wz_rad_s),
        ),
    )


def _mission(message: wire.MissionStatus) -> Mission:
    return Mission(**sample(message), mode=when(message.available, message.mode))


def _effective_command(message: wire.EffectiveCommand) -> EffectiveCommand:
    here = message.available
    return EffectiveCommand(
        **sample(message),
        vx_mps=number_when(here, message.vx_mps),
        vy_mps=number_when(here, message.vy_mps),
        wz_rad_s=number_when(here, message.wz_rad_s),
        active_source=when(here, message.active_source),
    )
