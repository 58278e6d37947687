"""The simulated robot's messages, as the real one would send them."""

import math
from collections.abc import Callable
from typing import Any

from common.errors import UserError
from simrobot.behaviour import Topic
from simrobot.motion import Box, pack_voltage
from simrobot.robot import Robot

try:
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
    from nav_msgs.msg import Odometry
    from omniseer_msgs.msg import VisionPerfSummary
    from sensor_msgs.msg import BatteryState
    from yolo_msgs.msg import Detection, DetectionArray
except ImportError as error:
    raise UserError(
        f"the simulated robot lacks a ROS 2 message package ({error})", "Type: scripts/setup"
    ) from error

_PICTURES_PER_S = 30.0
_LOW_PERCENT = 15.0

Build = Callable[[Robot, float, Any], Any]
"""Makes the message of this moment: the robot, the monotonic time in seconds, the ROS stamp."""


def odometry(robot: Robot, now_s: float, stamp: Any) -> Any:
    """nav_msgs/Odometry: the pose in "odom", the twist in "base_link"."""
    robot.advance(now_s)
    message = Odometry(child_frame_id="base_link")
    message.header.stamp = stamp
    message.header.frame_id = "odom"
    pose, twist = message.pose.pose, message.twist.twist
    pose.position.x, pose.position.y = robot.pose.x_m, robot.pose.y_m
    pose.orientation.z = math.sin(robot.pose.heading_rad / 2)
    pose.orientation.w = math.cos(robot.pose.heading_rad / 2)
    lost = math.nan if Topic.ODOMETRY in robot.behaviour.not_a_number else 0.0
    twist.linear.x = robot.behaviour.speed_mps + lost
    twist.angular.z = robot.behaviour.turn_rad_s + lost
    return message


def vision(robot: Robot, now_s: float, stamp: Any) -> Any:
    """omniseer_msgs/VisionPerfSummary of a process that captures and evaluates 30 pictures a second."""
    counts = robot.vision_counts(now_s, _PICTURES_PER_S)
    lost = math.nan if Topic.VISION in robot.behaviour.not_a_number else 0.0
    wave = math.sin(now_s)
    message = VisionPerfSummary(
        producer_fps=_PICTURES_PER_S + 0.3 * wave + lost,
        consumer_fps=_PICTURES_PER_S - 0.5 + 0.3 * wave + lost,
        last_preprocess_ms=2.1 + lost,
        last_infer_ms=18.0 + 2 * wave + lost,
        last_postprocess_ms=1.4 + lost,
        last_publish_ms=0.2 + lost,
        last_producer_total_ms=4.0 + lost,
        last_consumer_total_ms=22.0 + 2 * wave + lost,
        last_source_age_start_ms=9.0 + lost,
        last_source_age_end_ms=31.0 + 2 * wave + lost,
        produced_count=counts.produced,
        consumed_count=max(0, counts.produced - counts.infer_errors),
        infer_error_count=counts.infer_errors,
    )
    message.header.stamp = stamp
    return message


def detections(robot: Robot, now_s: float, stamp: Any) -> Any:
    """yolo_msgs/DetectionArray of a 1280x720 picture."""
    lost = math.nan if Topic.DETECTIONS in robot.behaviour.not_a_number else 0.0
    message = DetectionArray(detections=[_detection(box, lost) for box in robot.boxes(now_s)])
    message.header.stamp = stamp
    message.header.frame_id = "camera"
    return message


def _detection(box: Box, lost: float) -> Any:
    message = Detection(class_id=box.class_id, class_name=box.class_name, score=box.score, id=box.track_id)
    message.bbox.center.position.x = box.center_x_px + lost
    message.bbox.center.position.y = box.center_y_px + lost
    message.bbox.size.x = box.width_px + lost
    message.bbox.size.y = box.height_px + lost
    return message


def battery(robot: Robot, now_s: float, stamp: Any) -> Any:
    """sensor_msgs/BatteryState of a four-cell lithium pack."""
    percent = robot.battery_percent(now_s)
    lost = math.nan if Topic.BATTERY in robot.behaviour.not_a_number else 0.0
    charging = robot.behaviour.battery_drain_percent_per_s < 0
    message = BatteryState(
        present=True,
        voltage=pack_voltage(percent) + lost,
        percentage=percent / 100 + lost,
        power_supply_status=BatteryState.POWER_SUPPLY_STATUS_CHARGING
        if charging
        else BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
        power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_LIPO,
    )
    message.header.stamp = stamp
    return message


def diagnostics(robot: Robot, now_s: float, stamp: Any) -> Any:
    """diagnostic_msgs/DiagnosticArray: drive, battery and vision, each with its level."""
    percent = robot.battery_percent(now_s)
    failing = robot.behaviour.infer_errors_per_s > 0
    message = DiagnosticArray(
        status=[
            _status("drive: motor controller", DiagnosticStatus.OK, "running"),
            _status("power: battery", *_battery_level(percent), percent=f"{percent:.1f}"),
            _status(
                "vision: inference",
                DiagnosticStatus.ERROR if failing else DiagnosticStatus.OK,
                "inference fails" if failing else "running",
            ),
        ]
    )
    message.header.stamp = stamp
    return message


def _battery_level(percent: float) -> tuple[bytes, str]:
    if percent < _LOW_PERCENT:
        return DiagnosticStatus.ERROR, f"battery low: {percent:.0f} %"
    return DiagnosticStatus.OK, "charged"


def _status(name: str, level: bytes, text: str, **values: str) -> Any:
    return DiagnosticStatus(
        name=name,
        level=level,
        message=text,
        hardware_id="simulated",
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )


WHAT_IS_PUBLISHED: dict[Topic, tuple[str, Any, Build]] = {
    Topic.ODOMETRY: ("/odometry/filtered", Odometry, odometry),
    Topic.VISION: ("/vision/perf", VisionPerfSummary, vision),
    Topic.DETECTIONS: ("/yolo/detections", DetectionArray, detections),
    Topic.BATTERY: ("/battery", BatteryState, battery),
    Topic.DIAGNOSTICS: ("/diagnostics", DiagnosticArray, diagnostics),
}
"""Topic name, message type and how to make one. The gateway's default sources read these."""
