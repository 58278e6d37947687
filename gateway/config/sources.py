"""`sources`: the ROS 2 topics that the gateway reads."""

import re
from typing import Annotated, Any, Final, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from common.config import Section
from gateway.status.sources import ROS_SOURCES, SourceSpec
from gateway.status.values import CommandSource

KINDS: Final = tuple(dict.fromkeys(spec.kind for spec in ROS_SOURCES))
"""The values of `kind`, in the order of the table of sources."""
_SPECS: Final = {(spec.kind, spec.label): spec for spec in ROS_SOURCES}
_STALE_AFTER_MS: Final = {spec.kind: spec.stale_after_ms for spec in ROS_SOURCES}


_TOPIC: Final = re.compile(r"(~/|/)?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
"""A topic name as rcl_validate_topic_name accepts it, without substitutions."""
_LONGEST_TOPIC: Final = 247
"""RMW_TOPIC_MAX_NAME_LENGTH."""
_TYPE: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]*/msg/[A-Za-z][A-Za-z0-9_]*")


def _known_kind(kind: str) -> str:
    if kind not in KINDS:
        raise ValueError(f"one of {', '.join(KINDS)}")
    return kind


def _topic_name(topic: str) -> str:
    if not _TOPIC.fullmatch(topic) or len(topic) > _LONGEST_TOPIC:
        raise ValueError("a topic name of letters, digits, _ and /, /odometry/filtered for example")
    return topic


def _type_name(name: str) -> str:
    if not _TYPE.fullmatch(name):
        raise ValueError("a message type, nav_msgs/msg/Odometry for example")
    return name


class SourceSettings(Section):
    """One ROS 2 topic."""

    kind: Annotated[str, AfterValidator(_known_kind)]
    label: CommandSource | None = None
    """The input of the command mux (required for mux_input, invalid for other kinds)."""
    topic: Annotated[str, AfterValidator(_topic_name)]
    type: Annotated[str, AfterValidator(_type_name)]
    reliability: Literal["best_effort", "reliable"] = "best_effort"
    durability: Literal["volatile", "transient_local"] = "volatile"
    stale_after_ms: int = Field(default_factory=lambda validated: _STALE_AFTER_MS[validated["kind"]], gt=0)
    """Age from which the value is too old to rely on; the default depends on the kind."""
    required: bool = False
    """Whether the robot is degraded and not ready without this source."""
    image_width_px: int = Field(default=1280, gt=0)
    """Width of the image that the boxes of detections refer to; the messages don't hold it."""
    image_height_px: int = Field(default=720, gt=0)
    """Height of that image."""
    max_items: int = Field(default=100, ge=1, le=1000)
    """Number of detections of one image that are kept; all are counted."""

    @property
    def spec(self) -> SourceSpec[Any]:
        """The entry of the table of sources."""
        return _SPECS[self.kind, self.label]

    @property
    def name(self) -> str:
        """Unique, stable name for programs: "odometry", "mux_input.keyboard"."""
        return self.spec.name

    @model_validator(mode="after")
    def _check_label(self) -> Self:
        if (self.kind, self.label) not in _SPECS:
            labels = ", ".join(source.value for source in CommandSource)
            raise ValueError(f"a source of kind 'mux_input', and no other, has a label: {labels}")
        return self


_TWIST: Final = "geometry_msgs/msg/TwistStamped"

DEFAULT_SOURCES: Final = (
    SourceSettings(kind="odometry", topic="/odometry/filtered", type="nav_msgs/msg/Odometry", required=True),
    SourceSettings(
        kind="vision", topic="/vision/perf", type="omniseer_msgs/msg/VisionPerfSummary", required=True
    ),
    SourceSettings(kind="detections", topic="/yolo/detections", type="yolo_msgs/msg/DetectionArray"),
    SourceSettings(kind="battery", topic="/battery", type="sensor_msgs/msg/BatteryState"),
    SourceSettings(kind="diagnostics", topic="/diagnostics", type="diagnostic_msgs/msg/DiagnosticArray"),
    SourceSettings(kind="mux_input", label=CommandSource.KEYBOARD, topic="/cmd_vel_keyboard", type=_TWIST),
    SourceSettings(kind="mux_input", label=CommandSource.AUTONOMY, topic="/cmd_vel_autonomy", type=_TWIST),
    SourceSettings(kind="mux_input", label=CommandSource.NAVIGATION, topic="/cmd_vel_nav", type=_TWIST),
    SourceSettings(kind="effective_command", topic="/mecanum_drive_controller/reference", type=_TWIST),
)
"""The topics of the first robot. It publishes no mode; a robot that does has one more source."""
