"""The whole status, and the overlay, as messages of the contract."""

import math
from typing import Final

from gateway.rpc.calls.recipient import Recipient
from gateway.rpc.mapping.cloud import cloud_status
from gateway.rpc.mapping.enums import HEALTH_STATES, SOURCE_STATES
from gateway.rpc.mapping.faults import fill_fault
from gateway.rpc.mapping.freshness import freshness_fields
from gateway.rpc.mapping.info import gateway_facts
from gateway.rpc.mapping.platform import platform_status
from gateway.rpc.mapping.pose import orientation_status, position_status
from gateway.rpc.mapping.preview import preview_status
from gateway.rpc.mapping.recording import recording_status
from gateway.rpc.mapping.teleop import teleop_status
from gateway.rpc.mapping.values import fill_values
from gateway.status.command import Command
from gateway.status.event_log import OperatorEvent
from gateway.status.freshness import Sample, age_ms
from gateway.status.snapshot import Snapshot
from gateway.status.source_view import SourceView
from gateway.status.sources import (
    DETECTIONS,
    DIAGNOSTICS,
    EFFECTIVE_COMMAND,
    MODE,
    MUX_INPUTS,
    ODOMETRY,
    ORIENTATION,
    POSITION,
    VISION,
)
from gateway.status.values import Detection, Detections, Mode, Velocity, Vision
from omniseer.gateway.v1 import overlay_pb2, source_pb2, system_status_pb2

NOT_MAPPED: Final = frozenset({DIAGNOSTICS, EFFECTIVE_COMMAND, *MUX_INPUTS.values()})
"""Sources whose values have no field of their own: they become faults, or the attributed command."""

_UNATTRIBUTED: Final = "unknown"
"""The source of a command that can't be attributed."""


def system_status(snapshot: Snapshot, recipient: Recipient) -> system_status_pb2.SystemStatus:
    """Returns everything but detections and events.

    `teleop`, `recording` and `cloud` stay unset where the robot is not set up for them, which means "not
    available".
    """
    status = system_status_pb2.SystemStatus(
        gateway_name=snapshot.identity.name,
        gateway_version=snapshot.identity.version,
        preview=preview_status(snapshot.preview, snapshot.preview_measured, snapshot.pictures, recipient),
        vision=_vision(snapshot[VISION]),
        health=_health(snapshot),
        platform=platform_status(snapshot),
        effective_command=_command(snapshot.command),
        mission=_mission(snapshot[MODE]),
        position=position_status(snapshot[POSITION]),
        orientation=orientation_status(snapshot[ORIENTATION]),
        insecure=snapshot.identity.insecure,
        gateway=gateway_facts(snapshot.gateway),
        teleop=teleop_status(snapshot.teleop, snapshot.at_s) if snapshot.teleop else None,
        recording=recording_status(snapshot.recorder) if snapshot.recorder else None,
        cloud=cloud_status(snapshot.cloud, snapshot.at_s) if snapshot.cloud else None,
    )
    # In place: a message that is passed to a constructor is copied, which doubles the cost of a short one.
    for fault in snapshot.faults:
        fill_fault(status.faults.add(), fault, snapshot.at_s)
    for source in snapshot.sources:
        _fill_source(status.sources.add(), source)
    fill_values(status, snapshot)
    return status


def overlay_snapshot(snapshot: Snapshot, recipient: Recipient) -> overlay_pb2.OverlaySnapshot:
    """Returns status, detections and events of one instant."""
    return overlay_pb2.OverlaySnapshot(
        status=system_status(snapshot, recipient),
        detections=detections_message(snapshot[DETECTIONS]),
        events=[_event(event, snapshot.at_s) for event in snapshot.events],
    )


def _vision(sample: Sample[Vision]) -> system_status_pb2.VisionStatus:
    value = sample.value
    if value is None:
        return system_status_pb2.VisionStatus()
    return system_status_pb2.VisionStatus(
        **freshness_fields(sample.freshness),
        producer_fps=value.producer_fps,
        consumer_fps=value.consumer_fps,
        last_infer_ms=value.last_infer_ms,
        infer_error_count=value.infer_error_count,
        capture_fatal_error_count=value.capture_fatal_error_count,
    )


def _health(snapshot: Snapshot) -> system_status_pb2.RobotHealth:
    health, odometry = snapshot.health, snapshot[ODOMETRY]
    freshness = odometry.freshness
    motion = odometry.value or Velocity(vx_mps=0.0, vy_mps=0.0, wz_rad_s=0.0)
    return system_status_pb2.RobotHealth(
        state=HEALTH_STATES[health.state],
        ready=health.ready,
        summary=health.summary,
        odom_available=freshness.available,
        odom_stale=freshness.stale,
        linear_speed_mps=math.hypot(motion.vx_mps, motion.vy_mps),
        angular_speed_rad_s=abs(motion.wz_rad_s),
        odom_age_ms=freshness.age_ms,
        measured_vx_mps=motion.vx_mps,
        measured_vy_mps=motion.vy_mps,
        measured_wz_rad_s=motion.wz_rad_s,
    )


def _command(sample: Sample[Command]) -> system_status_pb2.EffectiveCommand:
    command = sample.value
    if command is None:
        return system_status_pb2.EffectiveCommand()
    return system_status_pb2.EffectiveCommand(
        **freshness_fields(sample.freshness),
        vx_mps=command.velocity.vx_mps,
        vy_mps=command.velocity.vy_mps,
        wz_rad_s=command.velocity.wz_rad_s,
        active_source=command.source.value if command.source else _UNATTRIBUTED,
    )


def _mission(sample: Sample[Mode]) -> system_status_pb2.MissionStatus:
    if sample.value is None:
        return system_status_pb2.MissionStatus()
    return system_status_pb2.MissionStatus(
        **freshness_fields(sample.freshness),
        mode=sample.value.name,
    )


def detections_message(sample: Sample[Detections]) -> overlay_pb2.DetectionOverlayStatus:
    """Returns the detections; an empty message, which reads "not available", before the first."""
    value = sample.value
    if value is None:
        return overlay_pb2.DetectionOverlayStatus()
    return overlay_pb2.DetectionOverlayStatus(
        **freshness_fields(sample.freshness),
        source_width_px=value.source_width_px,
        source_height_px=value.source_height_px,
        detection_count=value.count,
        detections=[_detection(item) for item in value.items],
    )


def _detection(item: Detection) -> overlay_pb2.OverlayDetection:
    return overlay_pb2.OverlayDetection(
        class_id=item.class_id,
        class_name=item.class_name,
        score=item.score,
        track_id=item.track_id,
        bbox_center_x_px=item.center_x_px,
        bbox_center_y_px=item.center_y_px,
        bbox_width_px=item.width_px,
        bbox_height_px=item.height_px,
    )


def _fill_source(message: source_pb2.SourceStatus, source: SourceView) -> None:
    available, stale, age = source.freshness
    message.name = source.spec.name
    message.state = SOURCE_STATES[source.state]
    message.available = available
    message.stale = stale
    message.age_ms = age
    message.required = source.required
    message.detail = source.detail


def _event(event: OperatorEvent, now_s: float) -> overlay_pb2.OperatorEvent:
    age = age_ms(event.at_s, now_s)
    return overlay_pb2.OperatorEvent(sequence=event.sequence, age_ms=age, message=event.message)
