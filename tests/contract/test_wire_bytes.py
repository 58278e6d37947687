"""Bytes written by hand from the locked numbers, decoded by the generated code.

The field numbers stand here a second time, on purpose: a schema and a test that were both made from a wrong
number would agree with each other. A field is (number, wire type, value) as protobuf's encoding lays it down.
"""

import struct
from dataclasses import dataclass
from typing import Any

import pytest
from google.protobuf.descriptor import Descriptor
from google.protobuf.message import Message

from omniseer.gateway.v1 import (
    cloud_pb2,
    event_pb2,
    fault_pb2,
    gateway_info_pb2,
    overlay_pb2,
    platform_pb2,
    pose_pb2,
    preview_pb2,
    recording_pb2,
    robot_gateway_pb2,
    source_pb2,
    states_pb2,
    system_status_pb2,
    teleop_pb2,
    value_pb2,
)

VARINT, FIXED64, LENGTH, FIXED32 = 0, 1, 2, 5


def varint(value: int) -> bytes:
    value &= (1 << 64) - 1
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def tag(number: int, wire_type: int) -> bytes:
    return varint(number << 3 | wire_type)


def uint(number: int, value: int) -> bytes:
    return tag(number, VARINT) + varint(value)


def flt(number: int, value: float) -> bytes:
    return tag(number, FIXED32) + struct.pack("<f", value)


def dbl(number: int, value: float) -> bytes:
    return tag(number, FIXED64) + struct.pack("<d", value)


def text(number: int, value: str) -> bytes:
    return sub(number, value.encode())


def sub(number: int, *parts: bytes) -> bytes:
    body = b"".join(parts)
    return tag(number, LENGTH) + varint(len(body)) + body


@dataclass(frozen=True)
class Case:
    message: type[Message]
    wire: bytes
    fields: dict[str, Any]


# Floats are multiples of 1/4, which binary floating point holds exactly.
COMPUTE = (
    uint(1, 1)
    + uint(2, 1)
    + uint(3, 300)
    + flt(4, 12.5)
    + uint(5, 1)
    + flt(6, 61.25)
    + uint(7, 1)
    + uint(8, 1)
) + (uint(9, 1 << 33) + uint(10, 1 << 34) + flt(11, 50.0) + uint(12, 1) + flt(13, 75.5))
NETWORK = (
    uint(1, 1) + uint(2, 1) + uint(3, 7) + uint(4, 1) + text(5, "wlan0") + uint(6, 1) + uint(7, -67)
) + (uint(8, 1) + uint(9, 80))
BATTERY = (
    uint(1, 1) + uint(2, 1) + uint(3, 9) + text(4, "lipo") + uint(5, 1) + uint(6, 1) + flt(7, 14.75)
) + (uint(8, 1) + flt(9, 82.5) + uint(10, 1) + uint(11, 1))
DETECTION = (
    uint(1, -3) + text(2, "person") + flt(3, 0.75) + text(4, "t7") + flt(5, 640.0) + flt(6, 360.0)
) + (flt(7, 100.5) + flt(8, 200.25))

CASES = [
    Case(
        system_status_pb2.SystemStatus,
        text(1, "lab")
        + text(2, "1.2.3")
        + sub(3, uint(1, 2))
        + sub(4, uint(1, 1))
        + sub(5, uint(1, 1))
        + sub(6, uint(1, 1))
        + sub(7, sub(1, uint(1, 1)))
        + sub(8, uint(1, 1)),
        {
            "gateway_name": "lab",
            "gateway_version": "1.2.3",
            "preview": preview_pb2.PreviewStatus(state=states_pb2.PREVIEW_RUNNING),
            "vision": system_status_pb2.VisionStatus(available=True),
            "health": system_status_pb2.RobotHealth(state=states_pb2.ROBOT_HEALTH_OK),
            "teleop": system_status_pb2.TeleopStatus(state=states_pb2.TELEOP_DISABLED),
            "platform": platform_pb2.PlatformStatus(compute=platform_pb2.ComputeStatus(available=True)),
            "effective_command": system_status_pb2.EffectiveCommand(available=True),
        },
    ),
    Case(
        robot_gateway_pb2.SetPreviewModeRequest,
        uint(1, 1) + uint(2, 3),
        {"enabled": True, "profile": preview_pb2.PREVIEW_PROFILE_HIGH_QUALITY},
    ),
    Case(
        robot_gateway_pb2.SetPreviewModeResponse,
        uint(1, 1) + text(2, "running") + sub(3, uint(2, 1)),
        {
            "accepted": True,
            "message": "running",
            "preview": preview_pb2.PreviewStatus(profile=preview_pb2.PREVIEW_PROFILE_LOW_BW),
        },
    ),
    Case(
        preview_pb2.PreviewStatus,
        uint(1, 5) + uint(2, 2) + text(3, "no camera"),
        {"state": 5, "profile": preview_pb2.PREVIEW_PROFILE_BALANCED, "last_error": "no camera"},
    ),
    Case(
        system_status_pb2.VisionStatus,
        uint(1, 1) + uint(2, 1) + flt(3, 30.0) + flt(4, 29.5) + flt(5, 12.25) + uint(6, 300) + uint(7, 2),
        {
            "available": True,
            "stale": True,
            "producer_fps": 30.0,
            "consumer_fps": 29.5,
            "last_infer_ms": 12.25,
            "infer_error_count": 300,
            "capture_fatal_error_count": 2,
        },
    ),
    Case(
        system_status_pb2.RobotHealth,
        uint(1, 2)
        + uint(2, 1)
        + text(3, "odometry stale")
        + uint(4, 1)
        + uint(5, 1)
        + flt(6, 1.25)
        + flt(7, 0.5)
        + uint(8, 1500)
        + flt(9, 1.0)
        + flt(10, -0.75)
        + flt(11, -0.5),
        {
            "state": 2,
            "ready": True,
            "summary": "odometry stale",
            "odom_available": True,
            "odom_stale": True,
            "linear_speed_mps": 1.25,
            "angular_speed_rad_s": 0.5,
            "odom_age_ms": 1500,
            "measured_vx_mps": 1.0,
            "measured_vy_mps": -0.75,
            "measured_wz_rad_s": -0.5,
        },
    ),
    Case(
        system_status_pb2.TeleopStatus,
        uint(1, 2)
        + uint(2, 1)
        + uint(4, 40)
        + flt(5, 1.5)
        + flt(6, 2.0)
        + text(7, "too fast")
        + flt(8, 0.25)
        + flt(9, 0.5)
        + flt(10, 0.75)
        + uint(11, 1)
        + uint(12, 1),
        {
            "state": 2,
            "enabled": True,
            "last_command_age_ms": 40,
            "max_linear_mps": 1.5,
            "max_angular_rad_s": 2.0,
            "last_error": "too fast",
            "last_command_vx_mps": 0.25,
            "last_command_vy_mps": 0.5,
            "last_command_wz_rad_s": 0.75,
            "last_command_available": True,
            "last_command_stale": True,
        },
    ),
    Case(
        system_status_pb2.EffectiveCommand,
        uint(1, 1) + uint(2, 1) + uint(3, 20) + flt(4, 1.0) + flt(5, 2.0) + flt(6, 3.0) + text(7, "keyboard"),
        {
            "available": True,
            "stale": True,
            "age_ms": 20,
            "vx_mps": 1.0,
            "vy_mps": 2.0,
            "wz_rad_s": 3.0,
            "active_source": "keyboard",
        },
    ),
    Case(
        platform_pb2.ComputeStatus,
        COMPUTE,
        {
            "available": True,
            "stale": True,
            "age_ms": 300,
            "cpu_percent": 12.5,
            "cpu_temperature_available": True,
            "cpu_temperature_c": 61.25,
            "thermal_throttled_available": True,
            "thermal_throttled": True,
            "ram_used_bytes": 1 << 33,
            "ram_total_bytes": 1 << 34,
            "ram_used_percent": 50.0,
            "disk_available": True,
            "disk_used_percent": 75.5,
        },
    ),
    Case(
        platform_pb2.NetworkStatus,
        NETWORK,
        {
            "available": True,
            "stale": True,
            "age_ms": 7,
            "connected": True,
            "interface_name": "wlan0",
            "wifi_signal_available": True,
            "wifi_signal_dbm": -67,
            "link_quality_available": True,
            "link_quality_percent": 80,
        },
    ),
    Case(
        platform_pb2.BatteryStatus,
        BATTERY,
        {
            "available": True,
            "stale": True,
            "age_ms": 9,
            "source": "lipo",
            "present": True,
            "voltage_available": True,
            "voltage": 14.75,
            "percentage_available": True,
            "percentage": 82.5,
            "charging_available": True,
            "charging": True,
        },
    ),
    Case(
        platform_pb2.PowerStatus,
        sub(1, uint(3, 1)) + sub(2, uint(3, 2)),
        {
            "lipo_battery": platform_pb2.BatteryStatus(age_ms=1),
            "onboard_battery": platform_pb2.BatteryStatus(age_ms=2),
        },
    ),
    Case(
        platform_pb2.PlatformStatus,
        sub(1, uint(3, 1)) + sub(2, uint(3, 2)) + sub(3, sub(1, uint(3, 3))),
        {
            "compute": platform_pb2.ComputeStatus(age_ms=1),
            "network": platform_pb2.NetworkStatus(age_ms=2),
            "power": platform_pb2.PowerStatus(lipo_battery=platform_pb2.BatteryStatus(age_ms=3)),
        },
    ),
    Case(
        overlay_pb2.OverlaySnapshot,
        sub(1, text(1, "lab")) + sub(2, uint(6, 3)) + sub(3, uint(1, 1)) + sub(3, uint(1, 2)),
        {
            "status": system_status_pb2.SystemStatus(gateway_name="lab"),
            "detections": overlay_pb2.DetectionOverlayStatus(detection_count=3),
            "events": [overlay_pb2.OperatorEvent(sequence=1), overlay_pb2.OperatorEvent(sequence=2)],
        },
    ),
    Case(
        overlay_pb2.DetectionOverlayStatus,
        uint(1, 1)
        + uint(2, 1)
        + uint(3, 66)
        + uint(4, 1280)
        + uint(5, 720)
        + uint(6, 2)
        + sub(7, uint(1, 1))
        + sub(7, uint(1, 2)),
        {
            "available": True,
            "stale": True,
            "age_ms": 66,
            "source_width_px": 1280,
            "source_height_px": 720,
            "detection_count": 2,
            "detections": [
                overlay_pb2.OverlayDetection(class_id=1),
                overlay_pb2.OverlayDetection(class_id=2),
            ],
        },
    ),
    Case(
        overlay_pb2.OverlayDetection,
        DETECTION,
        {
            "class_id": -3,
            "class_name": "person",
            "score": 0.75,
            "track_id": "t7",
            "bbox_center_x_px": 640.0,
            "bbox_center_y_px": 360.0,
            "bbox_width_px": 100.5,
            "bbox_height_px": 200.25,
        },
    ),
    Case(
        overlay_pb2.OperatorEvent,
        uint(1, 12) + uint(2, 3400) + text(3, "preview running"),
        {"sequence": 12, "age_ms": 3400, "message": "preview running"},
    ),
    Case(robot_gateway_pb2.GetSystemStatusRequest, b"", {}),
    Case(robot_gateway_pb2.GetOverlaySnapshotRequest, b"", {}),
    Case(robot_gateway_pb2.SetTeleopEnabledRequest, uint(1, 1), {"enabled": True}),
    Case(
        robot_gateway_pb2.SetTeleopEnabledResponse,
        uint(1, 1) + text(2, "enabled") + sub(3, uint(1, 2)),
        {
            "accepted": True,
            "message": "enabled",
            "teleop": system_status_pb2.TeleopStatus(state=states_pb2.TELEOP_ENABLED),
        },
    ),
    Case(
        robot_gateway_pb2.SendTeleopCommandRequest,
        flt(1, 0.25) + flt(2, -0.5) + flt(3, 0.75),
        {"linear_x_mps": 0.25, "linear_y_mps": -0.5, "angular_z_rad_s": 0.75},
    ),
    Case(
        robot_gateway_pb2.SendTeleopCommandResponse,
        uint(1, 1) + text(2, "passed on") + sub(3, uint(1, 1)),
        {
            "accepted": True,
            "message": "passed on",
            "teleop": system_status_pb2.TeleopStatus(state=states_pb2.TELEOP_DISABLED),
        },
    ),
]

# What was added to the locked contract: from 16 up in its messages, from 1 in messages of its own.
ADDITIONS = [
    Case(robot_gateway_pb2.SetPreviewModeRequest, text(16, "rear"), {"camera": "rear"}),
    Case(
        system_status_pb2.SystemStatus,
        uint(16, 1)
        + sub(17, text(1, "a"))
        + sub(17, text(1, "b"))
        + sub(18, text(4, "exploring"))
        + sub(19, text(1, "odometry"))
        + sub(20, uint(3, 61_000))
        + sub(23, text(1, "cell"))
        + sub(24, text(1, "gripper"))
        + sub(25, uint(4, 4))
        + sub(26, flt(4, 1.5)),
        {
            "insecure": True,
            "faults": [fault_pb2.Fault(id="a"), fault_pb2.Fault(id="b")],
            "mission": system_status_pb2.MissionStatus(mode="exploring"),
            "sources": [source_pb2.SourceStatus(name="odometry")],
            "gateway": gateway_info_pb2.GatewayFacts(uptime_ms=61_000),
            "numbers": [value_pb2.NumberStatus(label="cell")],
            "texts": [value_pb2.TextStatus(label="gripper")],
            "position": pose_pb2.PositionStatus(fix=pose_pb2.FIX_STATUS_GBAS),
            "orientation": pose_pb2.OrientationStatus(roll_deg=1.5),
        },
    ),
    Case(
        pose_pb2.PositionStatus,
        uint(1, 1)
        + uint(2, 1)
        + uint(3, 40)
        + uint(4, 2)
        + dbl(5, 48.1234567)
        + dbl(6, -11.5)
        + flt(7, 520.25)
        + flt(8, 1.5)
        + flt(9, 2.5),
        {
            "available": True,
            "stale": True,
            "age_ms": 40,
            "fix": pose_pb2.FIX_STATUS_FIX,
            "latitude_deg": 48.1234567,
            "longitude_deg": -11.5,
            "altitude_m": 520.25,
            "horizontal_accuracy_m": 1.5,
            "vertical_accuracy_m": 2.5,
        },
    ),
    Case(
        pose_pb2.OrientationStatus,
        uint(1, 1) + uint(2, 1) + uint(3, 40) + flt(4, 1.5) + flt(5, -2.5) + flt(6, 170.25),
        {
            "available": True,
            "stale": True,
            "age_ms": 40,
            "roll_deg": 1.5,
            "pitch_deg": -2.5,
            "yaw_deg": 170.25,
        },
    ),
    Case(
        value_pb2.TextStatus,
        text(1, "gripper")
        + text(2, "Gripper")
        + uint(3, 1)
        + uint(4, 1)
        + uint(5, 40)
        + text(6, "jam")
        + uint(7, 3)
        + uint(8, 1),
        {
            "label": "gripper",
            "title": "Gripper",
            "available": True,
            "stale": True,
            "age_ms": 40,
            "text": "jam",
            "level": value_pb2.TEXT_LEVEL_ERROR,
            "tile": True,
        },
    ),
    Case(
        value_pb2.NumberStatus,
        text(1, "cell")
        + text(2, "Cell 3")
        + uint(3, 1)
        + uint(4, 1)
        + uint(5, 40)
        + dbl(6, 3.3)
        + text(7, "V")
        + uint(8, 2)
        + uint(9, 2)
        + dbl(10, 3.0)
        + dbl(11, 3.4)
        + dbl(12, 4.1)
        + dbl(13, 4.3)
        + uint(14, 1),
        {
            "label": "cell",
            "title": "Cell 3",
            "available": True,
            "stale": True,
            "age_ms": 40,
            "value": 3.3,
            "unit": "V",
            "decimals": 2,
            "level": value_pb2.NUMBER_LEVEL_WARNING_LOW,
            "error_below": 3.0,
            "warning_below": 3.4,
            "warning_above": 4.1,
            "error_above": 4.3,
            "tile": True,
        },
    ),
    Case(system_status_pb2.VisionStatus, uint(16, 70), {"age_ms": 70}),
    Case(
        system_status_pb2.TeleopStatus,
        uint(16, 7) + uint(17, 4) + uint(17, 6) + text(18, "anna") + sub(19, uint(1, 12)) + uint(20, 500),
        {
            "phase": teleop_pb2.DRIVE_PHASE_STOPPED,
            "inhibits": [teleop_pb2.DRIVE_INHIBIT_PICTURE_STALE, teleop_pb2.DRIVE_INHIBIT_BASE_ABSENT],
            "holder": "anna",
            "stop": teleop_pb2.StopLatch(stop_id=12),
            "base_timeout_ms": 500,
        },
    ),
    Case(
        teleop_pb2.StopLatch,
        uint(1, 12) + text(2, "ben") + text(3, "a child") + uint(4, 900),
        {"stop_id": 12, "by": "ben", "reason": "a child", "age_ms": 900},
    ),
    Case(
        teleop_pb2.DriveRequest,
        sub(1, text(1, "tool")),
        {"open": teleop_pb2.DriveOpen(client_name="tool")},
    ),
    Case(teleop_pb2.DriveRequest, sub(2, uint(1, 7)), {"command": teleop_pb2.DriveCommand(sequence=7)}),
    Case(
        teleop_pb2.DriveOpen,
        text(1, "tool") + uint(2, 1) + text(3, "session") + uint(4, 2),
        {"client_name": "tool", "take_over": True, "session_id": "session", "supervision": 2},
    ),
    Case(
        teleop_pb2.DriveCommand,
        uint(1, 7)
        + uint(2, 1)
        + flt(3, 0.25)
        + flt(4, -0.5)
        + flt(5, 0.75)
        + uint(6, 1 << 40)
        + uint(7, 1 << 41)
        + uint(8, 1 << 42)
        + text(9, "gamepad"),
        {
            "sequence": 7,
            "held": True,
            "vx_mps": 0.25,
            "vy_mps": -0.5,
            "wz_rad_s": 0.75,
            "echo_monotonic_ns": 1 << 40,
            "picture_monotonic_ns": 1 << 41,
            "valid_until_monotonic_ns": 1 << 42,
            "input_device": "gamepad",
        },
    ),
    Case(
        teleop_pb2.DriveResponse,
        sub(1, text(1, "session")),
        {"opened": teleop_pb2.DriveOpened(session_id="session")},
    ),
    Case(teleop_pb2.DriveResponse, sub(2, uint(1, 5)), {"state": teleop_pb2.DriveState(monotonic_ns=5)}),
    Case(
        teleop_pb2.DriveOpened,
        text(1, "session") + text(2, "run") + sub(3, flt(1, 0.25)) + uint(4, 3),
        {
            "session_id": "session",
            "run_id": "run",
            "limits": teleop_pb2.DriveLimits(max_vx_mps=0.25),
            "max_lanes": 3,
        },
    ),
    Case(
        teleop_pb2.DriveLimits,
        flt(1, 0.25)
        + flt(2, 0.5)
        + flt(3, 0.75)
        + flt(4, 1.25)
        + flt(5, 1.5)
        + uint(6, 600)
        + flt(7, 0.125)
        + uint(8, 1)
        + flt(9, 1.75)
        + flt(10, 2.25),
        {
            "max_vx_mps": 0.25,
            "max_vy_mps": 0.5,
            "max_wz_rad_s": 0.75,
            "acceleration_mps2": 1.25,
            "acceleration_rad_s2": 1.5,
            "max_picture_age_ms": 600,
            "picture_travel_m": 0.125,
            "line_of_sight": True,
            "line_of_sight_mps": 1.75,
            "line_of_sight_rad_s": 2.25,
        },
    ),
    Case(
        teleop_pb2.DriveState,
        uint(1, 1 << 40)
        + uint(2, 7)
        + uint(3, 6)
        + uint(4, 1)
        + uint(4, 9)
        + flt(5, 0.25)
        + flt(6, -0.5)
        + flt(7, 0.75)
        + uint(8, 20)
        + uint(9, 30)
        + uint(10, 140)
        + flt(11, 1.25)
        + sub(12, uint(1, 3))
        + text(13, "no base")
        + flt(14, 0.5),
        {
            "monotonic_ns": 1 << 40,
            "newest_sequence": 7,
            "phase": teleop_pb2.DRIVE_PHASE_INHIBITED,
            "inhibits": [teleop_pb2.DRIVE_INHIBIT_COMMAND_LATE, teleop_pb2.DRIVE_INHIBIT_ACCESS_ENDED],
            "vx_mps": 0.25,
            "vy_mps": -0.5,
            "wz_rad_s": 0.75,
            "command_age_ms": 20,
            "loop_age_ms": 30,
            "picture_age_ms": 140,
            "speed_limit_mps": 1.25,
            "stop": teleop_pb2.StopLatch(stop_id=3),
            "problems": ["no base"],
            "turn_limit_rad_s": 0.5,
        },
    ),
    Case(
        teleop_pb2.StopRobotRequest,
        text(1, "a child") + text(2, "one"),
        {"reason": "a child", "request_id": "one"},
    ),
    Case(
        teleop_pb2.StopRobotResponse,
        text(1, "stopped") + sub(2, uint(1, 3)),
        {"message": "stopped", "stop": teleop_pb2.StopLatch(stop_id=3)},
    ),
    Case(teleop_pb2.ResetStopRequest, uint(1, 3), {"stop_id": 3}),
    Case(
        teleop_pb2.ResetStopResponse,
        text(1, "reset") + uint(2, 2),
        {"message": "reset", "phase": teleop_pb2.DRIVE_PHASE_AVAILABLE},
    ),
    Case(
        system_status_pb2.MissionStatus,
        uint(1, 1) + uint(2, 1) + uint(3, 5) + text(4, "docking"),
        {"available": True, "stale": True, "age_ms": 5, "mode": "docking"},
    ),
    Case(
        preview_pb2.PreviewStatus,
        sub(16, uint(3, 7100))
        + sub(17, text(1, "x264"))
        + sub(18, uint(1, 1280))
        + uint(19, 2500)
        + sub(20, uint(6, 2))
        + sub(21, uint(1, 3))
        + uint(22, 1)
        + text(23, "RTT 180 ms")
        + text(24, "rear")
        + sub(25, text(1, "rear")),
        {
            "endpoint": preview_pb2.StreamEndpoint(port=7100),
            "encoder": preview_pb2.EncoderStatus(name="x264"),
            "video": preview_pb2.VideoFormat(width_px=1280),
            "target_bitrate_kbps": 2500,
            "measured": preview_pb2.StreamMeasurement(viewer_count=2),
            "counters": preview_pb2.PreviewCounters(starts=3),
            "service_reachable": True,
            "bitrate_reason": "RTT 180 ms",
            "wanted_camera": "rear",
            "cameras": [preview_pb2.Camera(name="rear")],
        },
    ),
    Case(
        preview_pb2.Camera,
        text(1, "rear") + uint(2, 4) + text(3, "unplugged") + text(4, "front"),
        {
            "name": "rear",
            "state": preview_pb2.CAMERA_STATE_FAILED,
            "error": "unplugged",
            "fallback": "front",
        },
    ),
    Case(
        preview_pb2.StreamEndpoint,
        uint(1, 1)
        + text(2, "10.0.0.5")
        + uint(3, 7100)
        + text(4, "srt://10.0.0.5:7100")
        + uint(5, 125)
        + uint(6, 2)
        + uint(7, 1)
        + text(8, "secret")
        + uint(9, 1)
        + uint(10, -3_600_000_000_000),
        {
            "transport": 1,
            "host": "10.0.0.5",
            "port": 7100,
            "uri": "srt://10.0.0.5:7100",
            "latency_ms": 125,
            "codec": 2,
            "container": 1,
            "passphrase": "secret",
            "encrypted": True,
            "capture_offset_ns": -3_600_000_000_000,
        },
    ),
    Case(
        preview_pb2.EncoderStatus,
        text(1, "x264") + uint(2, 1) + text(3, "mpp-h265") + text(4, "not there") + uint(5, 1),
        {
            "name": "x264",
            "hardware": True,
            "wanted": "mpp-h265",
            "fallback_reason": "not there",
            "codec": 1,
        },
    ),
    Case(
        preview_pb2.VideoFormat,
        uint(1, 1280) + uint(2, 720) + flt(3, 29.5),
        {"width_px": 1280, "height_px": 720, "fps": 29.5},
    ),
    Case(
        preview_pb2.StreamMeasurement,
        uint(1, 1)
        + uint(2, 1)
        + uint(3, 400)
        + flt(4, 29.5)
        + flt(5, 2400.0)
        + uint(6, 3)
        + uint(7, 12)
        + flt(8, 4.5)
        + flt(9, 0.25)
        + uint(10, 140)
        + uint(11, 2)
        + uint(16, 1)
        + uint(17, 1)
        + uint(18, 4),
        {
            "available": True,
            "stale": True,
            "age_ms": 400,
            "fps": 29.5,
            "bitrate_kbps": 2400.0,
            "viewer_count": 3,
            "last_frame_age_ms": 12,
            "worst_rtt_ms": 4.5,
            "worst_loss_percent": 0.25,
            "worst_picture_age_ms": 140,
            "reporting_viewer_count": 2,
            "direct_viewer_count": 1,
            "srt_latency_viewer_count": 1,
            "most_packets_given_up": 4,
        },
    ),
    Case(
        preview_pb2.PreviewCounters,
        uint(1, 4) + uint(2, 3) + uint(3, 2) + uint(4, 1) + uint(5, 6),
        {"starts": 4, "restarts": 3, "faults": 2, "fallbacks": 1, "viewers_refused": 6},
    ),
    Case(
        fault_pb2.Fault,
        text(1, "odometry.stale")
        + uint(2, 3)
        + text(3, "odometry")
        + text(4, "it stopped")
        + text(5, "look")
        + uint(6, 1)
        + uint(7, 9000)
        + uint(8, 100)
        + uint(9, 2),
        {
            "id": "odometry.stale",
            "severity": fault_pb2.FAULT_SEVERITY_ERROR,
            "component": "odometry",
            "message": "it stopped",
            "remedy": "look",
            "active": True,
            "age_ms": 9000,
            "cleared_age_ms": 100,
            "times_raised": 2,
        },
    ),
    Case(
        source_pb2.SourceStatus,
        text(1, "battery") + uint(2, 5) + uint(3, 1) + uint(4, 1) + uint(5, 7) + uint(6, 1) + text(7, "why"),
        {
            "name": "battery",
            "state": source_pb2.SOURCE_STATE_QOS_MISMATCH,
            "available": True,
            "stale": True,
            "age_ms": 7,
            "required": True,
            "detail": "why",
        },
    ),
    Case(
        gateway_info_pb2.GatewayFacts,
        text(1, "abc")
        + text(2, "boot")
        + uint(3, 61_000)
        + uint(4, 2)
        + uint(5, 1 << 40)
        + uint(6, 7)
        + text(7, "run"),
        {
            "revision": "abc",
            "boot_id": "boot",
            "uptime_ms": 61_000,
            "client_count": 2,
            "requests_served": 1 << 40,
            "requests_refused": 7,
            "run_id": "run",
        },
    ),
    Case(
        event_pb2.Event,
        text(1, "run")
        + uint(2, 17)
        + uint(3, 1 << 41)
        + uint(4, 1 << 42)
        + uint(5, 2)
        + text(6, "preview")
        + text(7, "passed over")
        + sub(11, text(1, "x264") + text(2, "mpp-h265") + text(3, "not there")),
        {
            "run_id": "run",
            "sequence": 17,
            "monotonic_ns": 1 << 41,
            "wall_clock_unix_ms": 1 << 42,
            "severity": fault_pb2.FAULT_SEVERITY_WARNING,
            "component": "preview",
            "message": "passed over",
            "encoder_fallback": event_pb2.EncoderFallback(
                running="x264", wanted="mpp-h265", reason="not there"
            ),
        },
    ),
    Case(
        event_pb2.ControlAction,
        text(1, "anna")
        + text(2, "10.0.0.9")
        + text(3, "SetPreviewMode")
        + text(4, "on")
        + uint(5, 2)
        + text(6, "no"),
        {
            "who": "anna",
            "address": "10.0.0.9",
            "method": "SetPreviewMode",
            "request": "on",
            "result": event_pb2.CONTROL_RESULT_REFUSED,
            "answer": "no",
        },
    ),
    Case(
        event_pb2.EventGap,
        uint(1, 2) + uint(2, 40) + sub(3, text(1, "run") + uint(2, 40)),
        {
            "reason": event_pb2.EVENT_GAP_REASON_NEW_RUN,
            "missed_count": 40,
            "position": event_pb2.EventPosition(run_id="run", sequence=40),
        },
    ),
    Case(
        robot_gateway_pb2.WatchSystemStatusResponse,
        sub(1, text(1, "lab")) + uint(2, 1 << 41) + sub(16, uint(6, 3)),
        {
            "status": system_status_pb2.SystemStatus(gateway_name="lab"),
            "monotonic_ns": 1 << 41,
            "detections": overlay_pb2.DetectionOverlayStatus(detection_count=3),
        },
    ),
    Case(
        robot_gateway_pb2.SubscribeEventsRequest,
        sub(1, text(1, "run") + uint(2, 5)) + uint(2, 3),
        {
            "after": event_pb2.EventPosition(run_id="run", sequence=5),
            "min_severity": fault_pb2.FAULT_SEVERITY_ERROR,
        },
    ),
    Case(
        robot_gateway_pb2.PingResponse,
        uint(1, 1 << 41) + uint(2, 1 << 60) + text(3, "boot"),
        {"monotonic_ns": 1 << 41, "wall_clock_unix_ns": 1 << 60, "boot_id": "boot"},
    ),
    Case(robot_gateway_pb2.PingRequest, b"", {}),
    Case(robot_gateway_pb2.RequestKeyFrameRequest, uint(1, 1 << 32), {"newest_pts": 1 << 32}),
    Case(robot_gateway_pb2.RequestKeyFrameResponse, uint(1, 1), {"forced": True}),
    Case(
        robot_gateway_pb2.ReportPictureRequest,
        text(1, "left screen")
        + uint(2, 140)
        + uint(3, 2)
        + uint(4, 21)
        + flt(5, 2.5)
        + uint(6, 300)
        + uint(7, 4)
        + uint(8, 1)
        + uint(9, 90),
        {
            "viewer_id": "left screen",
            "picture_age_ms": 140,
            "picture_age_error_ms": 2,
            "rtt_ms": 21,
            "loss_percent": 2.5,
            "packets_held": 300,
            "packets_given_up": 4,
            "delivery": preview_pb2.PICTURE_DELIVERY_DIRECT,
            "link_age_ms": 90,
        },
    ),
    Case(robot_gateway_pb2.ReportPictureResponse, b"", {}),
    Case(robot_gateway_pb2.GetGatewayInfoRequest, b"", {}),
    Case(
        robot_gateway_pb2.GetGatewayInfoResponse,
        text(1, "lab")
        + text(2, "1.2.3")
        + sub(3, text(1, "abc"))
        + uint(4, 1 << 42)
        + sub(5, text(1, "Ping"))
        + text(6, "{}"),
        {
            "gateway_name": "lab",
            "gateway_version": "1.2.3",
            "gateway": gateway_info_pb2.GatewayFacts(revision="abc"),
            "wall_clock_unix_ms": 1 << 42,
            "methods": [gateway_info_pb2.MethodCounts(method="Ping")],
            "configuration_json": "{}",
        },
    ),
    Case(
        gateway_info_pb2.MethodCounts,
        text(1, "Ping") + uint(2, 1 << 40) + uint(3, 3) + uint(4, 2),
        {"method": "Ping", "served": 1 << 40, "refused": 3, "failed": 2},
    ),
    Case(
        robot_gateway_pb2.WatchSystemStatusRequest,
        uint(1, 200) + uint(16, 1),
        {"min_interval_ms": 200, "include_detections": True},
    ),
    Case(event_pb2.EventPosition, text(1, "run") + uint(2, 5), {"run_id": "run", "sequence": 5}),
    Case(
        robot_gateway_pb2.SubscribeEventsResponse,
        sub(1, uint(2, 5)),
        {"event": event_pb2.Event(sequence=5)},
    ),
    Case(
        robot_gateway_pb2.SubscribeEventsResponse,
        sub(2, uint(2, 5)),
        {"gap": event_pb2.EventGap(missed_count=5)},
    ),
    Case(
        robot_gateway_pb2.SubscribeEventsResponse,
        sub(3, uint(2, 5)),
        {"caught_up": event_pb2.EventPosition(sequence=5)},
    ),
    Case(
        event_pb2.Event,
        sub(8, sub(1, text(1, "a"))),
        {"fault_raised": event_pb2.FaultRaised(fault=fault_pb2.Fault(id="a"))},
    ),
    Case(
        event_pb2.Event,
        sub(9, sub(1, text(1, "a"))),
        {"fault_cleared": event_pb2.FaultCleared(fault=fault_pb2.Fault(id="a"))},
    ),
    Case(
        event_pb2.Event,
        sub(10, uint(1, 5)),
        {"preview_state_changed": event_pb2.PreviewStateChanged(state=states_pb2.PREVIEW_FAULTED)},
    ),
    Case(
        event_pb2.Event,
        sub(12, text(1, "10.0.0.9")),
        {"client_joined": event_pb2.ClientJoined(address="10.0.0.9")},
    ),
    Case(
        event_pb2.Event,
        sub(13, text(1, "10.0.0.9")),
        {"client_left": event_pb2.ClientLeft(address="10.0.0.9")},
    ),
    Case(event_pb2.Event, sub(14, text(1, "anna")), {"control_action": event_pb2.ControlAction(who="anna")}),
    Case(
        event_pb2.Event,
        sub(15, text(1, "idle")),
        {"robot_mode_changed": event_pb2.RobotModeChanged(mode="idle")},
    ),
    Case(event_pb2.FaultRaised, sub(1, text(1, "a")), {"fault": fault_pb2.Fault(id="a")}),
    Case(event_pb2.FaultCleared, sub(1, text(1, "a")), {"fault": fault_pb2.Fault(id="a")}),
    Case(
        event_pb2.PreviewStateChanged,
        uint(1, 5) + uint(2, 3) + text(3, "no camera") + text(4, "rear"),
        {
            "state": states_pb2.PREVIEW_FAULTED,
            "profile": preview_pb2.PREVIEW_PROFILE_HIGH_QUALITY,
            "last_error": "no camera",
            "camera": "rear",
        },
    ),
    Case(
        event_pb2.EncoderFallback,
        text(1, "x264") + text(2, "mpp-h265") + text(3, "not there"),
        {"running": "x264", "wanted": "mpp-h265", "reason": "not there"},
    ),
    Case(
        event_pb2.ClientJoined, text(1, "10.0.0.9") + text(2, "anna"), {"address": "10.0.0.9", "who": "anna"}
    ),
    Case(event_pb2.ClientLeft, text(1, "10.0.0.9") + text(2, "anna"), {"address": "10.0.0.9", "who": "anna"}),
    Case(event_pb2.RobotModeChanged, text(1, "idle"), {"mode": "idle"}),
]


def numbered(message: type[Message], *fields: tuple[int, str, Any]) -> Case:
    """A case of fields that are each a number, a name and a value; a list has one item."""
    wire, expected = b"", {}
    for number, name, value in fields:
        items = value if isinstance(value, list) else [value]
        for item in items:
            match item:
                case str():
                    wire += text(number, item)
                case bytes():
                    wire += sub(number, item)
                case int():
                    wire += uint(number, item)
                case Case():
                    wire += sub(number, item.wire)
        values = [each.message(**each.fields) if isinstance(each, Case) else each for each in items]
        expected[name] = values if isinstance(value, list) else values[0]
    return Case(message, wire, expected)


SUM = bytes(range(32))
PRESET = numbered(
    recording_pb2.RecordingPreset,
    (1, "name", "driving"),
    (2, "description", "what driving needs"),
    (3, "with_video", True),
    (4, "bytes_per_minute", 1 << 33),
    (5, "in_ring", True),
)
RECORDING_STATUS = numbered(
    recording_pb2.RecordingStatus,
    (1, "state", recording_pb2.RECORDER_STATE_UNREACHABLE),
    (2, "recording_id", "a"),
    (3, "label", "lap"),
    (4, "preset", "driving"),
    (5, "elapsed_ms", 1 << 34),
    (6, "size", 1 << 35),
    (7, "messages_written", 1 << 36),
    (8, "messages_lost", 0),
    (9, "video", True),
    (10, "bytes_per_s", 1 << 37),
    (11, "room_bytes", 1 << 38),
    (12, "room_s", 0),
    (13, "ring_s", 30),
    (14, "snapshots_pending", 2),
    (15, "recordings", 3),
    (16, "to_copy", 4),
    (17, "last_error", "full"),
    (18, "presets", [PRESET]),
    (19, "uncounted_gaps", 5),
)
RECORDING_COPY = numbered(
    recording_pb2.RecordingCopy,
    (1, "state", recording_pb2.RECORDING_COPY_STATE_FAILED),
    (2, "reason", "no network"),
    (3, "bytes_done", 1 << 33),
)
RECORDING_GAP = numbered(
    recording_pb2.RecordingGap,
    (1, "cause", recording_pb2.RECORDING_GAP_CAUSE_DISK),
    (2, "began_unix_ms", 1 << 40),
    (3, "ended_unix_ms", 1 << 41),
    (4, "messages", 0),
)
RECORDING_FILE = numbered(
    recording_pb2.RecordingFile,
    (1, "name", "data/000000.mcap"),
    (2, "size", 1 << 33),
    (3, "sha256", SUM),
    (4, "final", True),
)
RECORDING = numbered(
    recording_pb2.Recording,
    (1, "id", "a"),
    (2, "label", "lap"),
    (3, "notes", "wet"),
    (4, "kind", recording_pb2.RECORDING_KIND_RUN_BUNDLE),
    (5, "state", recording_pb2.RECORDING_STATE_FAULTED),
    (6, "stop_reason", recording_pb2.RECORDING_STOP_REASON_INTERRUPTED),
    (7, "preset", "driving"),
    (8, "started_unix_ms", 1 << 40),
    (9, "ended_unix_ms", 1 << 41),
    (10, "started_monotonic_ns", 1 << 42),
    (11, "ended_monotonic_ns", 1 << 43),
    (12, "boot_id", "boot"),
    (13, "recorder_run_id", "run"),
    (14, "duration_ms", 1 << 34),
    (15, "size", 1 << 35),
    (16, "messages_written", 1 << 36),
    (17, "messages_lost", 0),
    (18, "video_frames", 1 << 37),
    (19, "trigger", "anna"),
    (20, "pinned", True),
    (21, "copy", RECORDING_COPY),
    (22, "file_count", 1),
    (23, "gap_count", 2),
    (24, "files", [RECORDING_FILE]),
    (25, "gaps", [RECORDING_GAP]),
    (26, "sha256", SUM),
    (27, "uncounted_gaps", 3),
)
EXPORT_HEADER = numbered(recording_pb2.ExportHeader, (1, "size", 1 << 33), (2, "sha256", SUM))
EXPORT_CHUNK = Case(
    recording_pb2.ExportChunk,
    uint(1, 1 << 33) + sub(2, b"data") + tag(3, FIXED32) + struct.pack("<I", 0xE3069283),
    {"offset": 1 << 33, "data": b"data", "crc32c": 0xE3069283},
)
RECORDING_CHANGED = numbered(
    event_pb2.RecordingStateChanged,
    (1, "change", event_pb2.RECORDING_CHANGE_LOSS),
    (2, "recording_id", "a"),
    (3, "label", "lap"),
    (4, "kind", recording_pb2.RECORDING_KIND_INCIDENT),
    (5, "state", recording_pb2.RECORDING_STATE_COMPLETE),
    (6, "stop_reason", recording_pb2.RECORDING_STOP_REASON_DISK),
    (7, "messages_lost", 0),
    (8, "uncounted_gaps", 3),
)
CLOUD_STATUS = numbered(
    cloud_pb2.CloudStatus,
    (1, "state", cloud_pb2.CLOUD_STATE_UNREACHABLE),
    (2, "robot", "lab-1"),
    (3, "fleet", "lab"),
    (4, "state_age_ms", 1 << 34),
    (5, "outbox_events", 1 << 35),
    (6, "outbox_bytes", 1 << 36),
    (7, "outbox_max_bytes", 1 << 37),
    (8, "events_dropped", 1 << 38),
    (9, "events_sent", 1 << 39),
    (10, "last_sent_age_ms", 0),
    (11, "uploads_waiting", 3),
    (12, "uploading_id", "a"),
    (13, "uploading", RECORDING_COPY),
    (14, "uploading_size", 1 << 40),
    (15, "upload_bytes_per_s", 1 << 41),
    (16, "uploads_paused", "at night"),
    (17, "last_error", "gone"),
    (18, "uploads_left_out", 4),
)
CLOUD_CHANGED = numbered(
    event_pb2.CloudStateChanged, (1, "state", cloud_pb2.CLOUD_STATE_REFUSED), (2, "last_error", "revoked")
)
COPY_CHANGED = numbered(
    event_pb2.RecordingCopyChanged, (1, "recording_id", "a"), (2, "label", "lap"), (3, "copy", RECORDING_COPY)
)
_ANSWER = ((1, "message", "done"), (2, "recording", RECORDING))
_REQUESTED = (1, "request_id", "id")
RECORDINGS = [
    PRESET,
    RECORDING_STATUS,
    RECORDING_COPY,
    RECORDING_GAP,
    RECORDING_FILE,
    RECORDING,
    EXPORT_HEADER,
    EXPORT_CHUNK,
    RECORDING_CHANGED,
    numbered(event_pb2.Event, (16, "recording_state_changed", RECORDING_CHANGED)),
    numbered(system_status_pb2.SystemStatus, (21, "recording", RECORDING_STATUS)),
    numbered(
        recording_pb2.StartRecordingRequest,
        _REQUESTED,
        (2, "label", "lap"),
        (3, "notes", "wet"),
        (4, "preset", "driving"),
        (5, "with_video", False),
        (6, "max_duration_s", 60),
        (7, "max_bytes", 1 << 33),
    ),
    numbered(recording_pb2.StartRecordingResponse, *_ANSWER),
    numbered(recording_pb2.StopRecordingRequest, _REQUESTED, (2, "recording_id", "a")),
    numbered(recording_pb2.StopRecordingResponse, *_ANSWER),
    numbered(
        recording_pb2.TriggerSnapshotRequest,
        _REQUESTED,
        (2, "pre_s", 0),
        (3, "post_s", 0),
        (4, "label", "lap"),
        (5, "preset", "driving"),
    ),
    numbered(recording_pb2.TriggerSnapshotResponse, *_ANSWER),
    numbered(recording_pb2.ListRecordingsRequest, (1, "page_size", 50), (2, "page_token", "next")),
    numbered(
        recording_pb2.ListRecordingsResponse,
        (1, "recordings", [RECORDING]),
        (2, "next_page_token", "next"),
        (3, "status", RECORDING_STATUS),
    ),
    numbered(recording_pb2.GetRecordingRequest, (1, "recording_id", "a"), (2, "page_token", "next")),
    numbered(recording_pb2.GetRecordingResponse, (1, "recording", RECORDING), (2, "next_page_token", "next")),
    numbered(
        recording_pb2.ExportRecordingRequest,
        (1, "recording_id", "a"),
        (2, "file", "data/000000.mcap"),
        (3, "offset", 1 << 33),
        (4, "expected_sha256", SUM),
        (5, "max_bytes_per_s", 1 << 34),
    ),
    numbered(recording_pb2.ExportRecordingResponse, (1, "header", EXPORT_HEADER)),
    numbered(recording_pb2.ExportRecordingResponse, (2, "chunk", EXPORT_CHUNK)),
    numbered(recording_pb2.GetRecordingThumbnailRequest, (1, "recording_id", "a")),
    numbered(
        recording_pb2.GetRecordingThumbnailResponse,
        (1, "key_frame", SUM),
        (2, "format", "h265"),
        (3, "captured_unix_ms", 1 << 40),
    ),
    numbered(recording_pb2.PinRecordingRequest, _REQUESTED, (2, "recording_id", "a"), (3, "pinned", True)),
    numbered(recording_pb2.PinRecordingResponse, *_ANSWER),
    numbered(
        recording_pb2.DeleteRecordingRequest,
        _REQUESTED,
        (2, "recording_id", "a"),
        (3, "expected_sha256", SUM),
        (4, "force", True),
    ),
    numbered(recording_pb2.DeleteRecordingResponse, (1, "message", "done")),
    CLOUD_STATUS,
    CLOUD_CHANGED,
    COPY_CHANGED,
    numbered(event_pb2.Event, (17, "cloud_state_changed", CLOUD_CHANGED)),
    numbered(event_pb2.Event, (18, "recording_copy_changed", COPY_CHANGED)),
    numbered(system_status_pb2.SystemStatus, (22, "cloud", CLOUD_STATUS)),
    numbered(recording_pb2.UploadRecordingRequest, _REQUESTED, (2, "recording_id", "a")),
    numbered(recording_pb2.UploadRecordingResponse, (1, "message", "done"), (2, "copy", RECORDING_COPY)),
    numbered(recording_pb2.CancelUploadRequest, _REQUESTED, (2, "recording_id", "a")),
    numbered(recording_pb2.CancelUploadResponse, (1, "message", "done")),
]


@pytest.mark.parametrize(
    "case", [*CASES, *ADDITIONS, *RECORDINGS], ids=lambda case: case.message.DESCRIPTOR.name
)
def test_bytes_by_hand_mean_what_the_contract_says(case: Case) -> None:
    message = case.message.FromString(case.wire)

    assert {field.name for field, _ in message.ListFields()} == set(case.fields)
    for name, expected in case.fields.items():
        value = getattr(message, name)
        assert (list(value) if isinstance(expected, list) else value) == expected, name


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.message.DESCRIPTOR.name)
def test_every_locked_field_has_its_byte_string(case: Case) -> None:
    locked = {field.name for field in case.message.DESCRIPTOR.fields if field.number < 16}
    assert set(case.fields) == locked


def messages_below(message: Descriptor, found: dict[str, Descriptor]) -> None:
    """Adds a message of this package and all that stand in it."""
    if message.full_name in found or message.file.package != robot_gateway_pb2.DESCRIPTOR.package:
        return
    found[message.full_name] = message
    for field in message.fields:
        if field.message_type:
            messages_below(field.message_type, found)


def test_every_field_of_every_message_has_its_byte_string() -> None:
    reachable: dict[str, Descriptor] = {}
    for service in (
        robot_gateway_pb2.DESCRIPTOR.services_by_name["RobotGateway"],
        teleop_pb2.DESCRIPTOR.services_by_name["TeleopService"],
        recording_pb2.DESCRIPTOR.services_by_name["RecordingService"],
    ):
        for method in service.methods:
            messages_below(method.input_type, reachable)
            messages_below(method.output_type, reachable)
    written: dict[str, set[str]] = {}
    for case in [*CASES, *ADDITIONS, *RECORDINGS]:
        written.setdefault(case.message.DESCRIPTOR.full_name, set()).update(case.fields)
    assert written == {name: {field.name for field in message.fields} for name, message in reachable.items()}


@pytest.mark.parametrize(
    ("enum", "numbers"),
    [
        (
            "omniseer.gateway.v1.PreviewState",
            {
                "PREVIEW_STATE_UNSPECIFIED": 0,
                "PREVIEW_DISABLED": 1,
                "PREVIEW_RUNNING": 2,
                "PREVIEW_STARTING": 3,
                "PREVIEW_STOPPING": 4,
                "PREVIEW_FAULTED": 5,
            },
        ),
        (
            "omniseer.gateway.v1.PreviewProfile",
            {
                "PREVIEW_PROFILE_UNSPECIFIED": 0,
                "PREVIEW_PROFILE_LOW_BW": 1,
                "PREVIEW_PROFILE_BALANCED": 2,
                "PREVIEW_PROFILE_HIGH_QUALITY": 3,
            },
        ),
        (
            "omniseer.gateway.v1.RobotHealthState",
            {"ROBOT_HEALTH_STATE_UNSPECIFIED": 0, "ROBOT_HEALTH_OK": 1, "ROBOT_HEALTH_DEGRADED": 2},
        ),
        (
            "omniseer.gateway.v1.TeleopState",
            {"TELEOP_STATE_UNSPECIFIED": 0, "TELEOP_DISABLED": 1, "TELEOP_ENABLED": 2},
        ),
    ],
)
def test_enum_values_keep_their_numbers(enum: str, numbers: dict[str, int]) -> None:
    pool = system_status_pb2.DESCRIPTOR.pool
    assert {value.name: value.number for value in pool.FindEnumTypeByName(enum).values} == numbers


def test_methods_keep_their_paths() -> None:
    service = robot_gateway_pb2.DESCRIPTOR.services_by_name["RobotGateway"]
    assert service.full_name == "omniseer.gateway.v1.RobotGateway"
    locked = {
        "GetSystemStatus": ("GetSystemStatusRequest", "SystemStatus"),
        "SetPreviewMode": ("SetPreviewModeRequest", "SetPreviewModeResponse"),
        "GetOverlaySnapshot": ("GetOverlaySnapshotRequest", "OverlaySnapshot"),
    }
    found = {method.name: (method.input_type.name, method.output_type.name) for method in service.methods}
    assert locked.items() <= found.items()
