"""The simulated robot's messages, as the real one would send them."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from common.errors import UserError
from simrobot.behaviour import Commander, Component, Level, Topic
from simrobot.motion import Box, pack_voltage
from simrobot.robot import Robot

try:
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
    from geometry_msgs.msg import TwistStamped
    from nav_msgs.msg import Odometry
    from omniseer_msgs.msg import VisionPerfSummary
    from sensor_msgs.msg import BatteryState
    from std_msgs.msg import String
    from yolo_msgs.msg import Detection, DetectionArray
except ImportError as error:
    raise UserError(
        f"the simulated robot lacks a ROS 2 message package ({error})", "Type: scripts/setup"
    ) from error

_PICTURES_PER_S = 30.0
_LOW_PERCENT = 15.0
_NAMES = {
    Component.DRIVE: "drive: motor controller",
    Component.BATTERY: "power: battery",
    Component.VISION: "vision: inference",
    Component.LIDAR: "lidar: driver",
}
_LEVELS = {
    Level.OK: DiagnosticStatus.OK,
    Level.WARNING: DiagnosticStatus.WARN,
    Level.ERROR: DiagnosticStatus.ERROR,
    Level.STALE: DiagnosticStatus.STALE,
}
_SAYINGS = {
    Level.OK: "running",
    Level.WARNING: "not as it should be",
    Level.ERROR: "failed",
    Level.STALE: "no data received",
}

Build = Callable[[Robot, float, Any], Any]
"""Makes the message of this moment: the robot, the monotonic time in seconds, the ROS stamp.

None when there is nothing to tell."""


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
    """diagnostic_msgs/DiagnosticArray: every component with its level."""
    message = DiagnosticArray(status=[_status(robot, each, now_s) for each in Component])
    message.header.stamp = stamp
    return message


def _status(robot: Robot, component: Component, now_s: float) -> Any:
    level, text = _true_state(robot, component, now_s)
    if component in robot.behaviour.components:
        level = robot.behaviour.components[component]
        text = _SAYINGS[level]
    return DiagnosticStatus(
        name=_NAMES[component],
        level=_LEVELS[level],
        message=text,
        hardware_id="simulated",
        values=[KeyValue(key="charge", value=f"{robot.battery_percent(now_s):.1f} %")],
    )


def _true_state(robot: Robot, component: Component, now_s: float) -> tuple[Level, str]:
    percent = robot.battery_percent(now_s)
    if component is Component.BATTERY and percent < _LOW_PERCENT:
        return Level.ERROR, f"battery low: {percent:.0f} %"
    if component is Component.VISION and robot.behaviour.infer_errors_per_s > 0:
        return Level.ERROR, "inference fails"
    return Level.OK, _SAYINGS[Level.OK]


def mode(robot: Robot, now_s: float, stamp: Any) -> Any:
    """std_msgs/String, when the mode is another than the one told last."""
    return String(data=robot.behaviour.mode) if robot.news_of_mode() else None


def command_of(commander: Commander, robot: Robot, now_s: float, stamp: Any) -> Any:
    """geometry_msgs/TwistStamped: what one of the mux's inputs asks for, while it is the one that drives."""
    return _command(robot, stamp) if robot.behaviour.commander is commander else None


def effective_command(robot: Robot, now_s: float, stamp: Any) -> Any:
    """geometry_msgs/TwistStamped: what the mux lets through."""
    return None if robot.behaviour.commander is Commander.NOBODY else _command(robot, stamp)


def _command(robot: Robot, stamp: Any) -> Any:
    lost = math.nan if Topic.EFFECTIVE_COMMAND in robot.behaviour.not_a_number else 0.0
    message = TwistStamped()
    message.header.stamp = stamp
    message.header.frame_id = "base_link"
    message.twist.linear.x = robot.behaviour.speed_mps + lost
    message.twist.angular.z = robot.behaviour.turn_rad_s + lost
    return message


@dataclass(frozen=True, slots=True)
class Publication:
    """What is published where. `latched`: whoever comes later hears the last message, too."""

    topic: str
    message_type: Any
    build: Build
    latched: bool = False


PUBLICATIONS: dict[Topic, Publication] = {
    Topic.ODOMETRY: Publication("/odometry/filtered", Odometry, odometry),
    Topic.VISION: Publication("/vision/perf", VisionPerfSummary, vision),
    Topic.DETECTIONS: Publication("/yolo/detections", DetectionArray, detections),
    Topic.BATTERY: Publication("/battery", BatteryState, battery),
    Topic.DIAGNOSTICS: Publication("/diagnostics", DiagnosticArray, diagnostics),
    Topic.MODE: Publication("/mission/mode", String, mode, latched=True),
    Topic.KEYBOARD_COMMANDS: Publication(
        "/cmd_vel_keyboard", TwistStamped, partial(command_of, Commander.KEYBOARD)
    ),
    Topic.AUTONOMY_COMMANDS: Publication(
        "/cmd_vel_autonomy", TwistStamped, partial(command_of, Commander.AUTONOMY)
    ),
    Topic.NAVIGATION_COMMANDS: Publication(
        "/cmd_vel_nav", TwistStamped, partial(command_of, Commander.NAVIGATION)
    ),
    Topic.EFFECTIVE_COMMAND: Publication(
        "/mecanum_drive_controller/reference", TwistStamped, effective_command
    ),
}
"""The gateway's default sources read these, all but the mode."""
