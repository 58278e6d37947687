"""Builds the simulated robot's messages, as the real one would send them."""

import math
from collections.abc import Callable
from dataclasses import dataclass
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

_FRAMES_PER_S = 30.0
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
_TEXTS = {
    Level.OK: "running",
    Level.WARNING: "out of tolerance",
    Level.ERROR: "failed",
    Level.STALE: "no data received",
}

Build = Callable[[Robot, float], Any]
"""Builds the message of a monotonic time in seconds, without its stamp; None if there is none to send."""


def _nan_if_lost(robot: Robot, topic: Topic) -> float:
    """Returns NaN if the measured values of this topic are to be NaN, else 0; added to each of them."""
    return math.nan if topic in robot.behaviour.not_a_number else 0.0


def odometry(robot: Robot, now_s: float) -> Any:
    """Builds nav_msgs/Odometry: the pose in frame "odom", the twist in "base_link"."""
    robot.advance(now_s)
    message = Odometry(child_frame_id="base_link")
    message.header.frame_id = "odom"
    pose, twist = message.pose.pose, message.twist.twist
    pose.position.x, pose.position.y = robot.pose.x_m, robot.pose.y_m
    pose.orientation.z = math.sin(robot.pose.heading_rad / 2)
    pose.orientation.w = math.cos(robot.pose.heading_rad / 2)
    lost = _nan_if_lost(robot, Topic.ODOMETRY)
    velocity = robot.velocity(now_s)
    twist.linear.x = velocity.vx_mps + lost
    twist.linear.y = velocity.vy_mps + lost
    twist.angular.z = velocity.wz_rad_s + lost
    return message


def vision(robot: Robot, now_s: float) -> Any:
    """Builds omniseer_msgs/VisionPerfSummary of a process with 30 frames per second."""
    counts = robot.vision_counts(now_s, _FRAMES_PER_S)
    lost = _nan_if_lost(robot, Topic.VISION)
    wave = math.sin(now_s)
    return VisionPerfSummary(
        producer_fps=_FRAMES_PER_S + 0.3 * wave + lost,
        consumer_fps=_FRAMES_PER_S - 0.5 + 0.3 * wave + lost,
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


def detections(robot: Robot, now_s: float) -> Any:
    """Builds yolo_msgs/DetectionArray of a frame of 1280x720 pixels."""
    lost = _nan_if_lost(robot, Topic.DETECTIONS)
    message = DetectionArray(detections=[_detection(box, lost) for box in robot.boxes(now_s)])
    message.header.frame_id = "camera"
    return message


def _detection(box: Box, lost: float) -> Any:
    message = Detection(class_id=box.class_id, class_name=box.class_name, score=box.score, id=box.track_id)
    message.bbox.center.position.x = box.center_x_px + lost
    message.bbox.center.position.y = box.center_y_px + lost
    message.bbox.size.x = box.width_px + lost
    message.bbox.size.y = box.height_px + lost
    return message


def battery(robot: Robot, now_s: float) -> Any:
    """Builds sensor_msgs/BatteryState of a four-cell lithium pack."""
    percent = robot.battery_percent(now_s)
    lost = _nan_if_lost(robot, Topic.BATTERY)
    charging = robot.behaviour.battery_drain_percent_per_s < 0
    return BatteryState(
        present=True,
        voltage=pack_voltage(percent) + lost,
        percentage=percent / 100 + lost,
        power_supply_status=BatteryState.POWER_SUPPLY_STATUS_CHARGING
        if charging
        else BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
        power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_LIPO,
    )


def diagnostics(robot: Robot, now_s: float) -> Any:
    """Builds diagnostic_msgs/DiagnosticArray: the level of every component."""
    return DiagnosticArray(status=[_status(robot, each, now_s) for each in Component])


def _status(robot: Robot, component: Component, now_s: float) -> Any:
    level, text = _actual_state(robot, component, now_s)
    if component in robot.behaviour.components:
        level = robot.behaviour.components[component]
        text = _TEXTS[level]
    return DiagnosticStatus(
        name=_NAMES[component],
        level=_LEVELS[level],
        message=text,
        hardware_id="simulated",
        values=[KeyValue(key="charge", value=f"{robot.battery_percent(now_s):.1f} %")],
    )


def _actual_state(robot: Robot, component: Component, now_s: float) -> tuple[Level, str]:
    percent = robot.battery_percent(now_s)
    if component is Component.BATTERY and percent < _LOW_PERCENT:
        return Level.ERROR, f"battery low: {percent:.0f} %"
    if component is Component.VISION and robot.behaviour.infer_errors_per_s > 0:
        return Level.ERROR, "inference fails"
    return Level.OK, _TEXTS[Level.OK]


def mode(robot: Robot, _now_s: float) -> Any:
    """Builds std_msgs/String after a change of the mode."""
    return String(data=robot.behaviour.mode) if robot.mode_changed() else None


def effective_command(robot: Robot, _now_s: float) -> Any:
    """Builds geometry_msgs/TwistStamped of the mux's output."""
    return None if robot.behaviour.commander is Commander.NOBODY else _command(robot)


def _command(robot: Robot) -> Any:
    lost = _nan_if_lost(robot, Topic.EFFECTIVE_COMMAND)
    message = TwistStamped()
    message.header.frame_id = "base_link"
    message.twist.linear.x = robot.behaviour.speed_mps + lost
    message.twist.angular.z = robot.behaviour.turn_rad_s + lost
    return message


@dataclass(frozen=True, slots=True)
class Publication:
    """Name, type and builder of a topic. `latched`: late subscribers get the last message, too."""

    topic: str
    message_type: Any
    build: Build
    latched: bool = False


def _mux_input(topic: str, commander: Commander) -> Publication:
    """Returns a publication of geometry_msgs/TwistStamped on one input, silent unless the mux selects it."""

    def build(robot: Robot, _now_s: float) -> Any:
        return _command(robot) if robot.behaviour.commander is commander else None

    return Publication(topic, TwistStamped, build)


PUBLICATIONS: dict[Topic, Publication] = {
    Topic.ODOMETRY: Publication("/odometry/filtered", Odometry, odometry),
    Topic.VISION: Publication("/vision/perf", VisionPerfSummary, vision),
    Topic.DETECTIONS: Publication("/yolo/detections", DetectionArray, detections),
    Topic.BATTERY: Publication("/battery", BatteryState, battery),
    Topic.DIAGNOSTICS: Publication("/diagnostics", DiagnosticArray, diagnostics),
    Topic.MODE: Publication("/mission/mode", String, mode, latched=True),
    Topic.KEYBOARD_COMMANDS: _mux_input("/cmd_vel_keyboard", Commander.KEYBOARD),
    Topic.AUTONOMY_COMMANDS: _mux_input("/cmd_vel_autonomy", Commander.AUTONOMY),
    Topic.NAVIGATION_COMMANDS: _mux_input("/cmd_vel_nav", Commander.NAVIGATION),
    Topic.EFFECTIVE_COMMAND: Publication(
        "/mecanum_drive_controller/reference", TwistStamped, effective_command
    ),
}
"""The gateway's default sources subscribe to all of these but the mode."""
