"""The gateway's settings: one YAML file, overridden by `GATEWAY__...` environment variables."""

from typing import Literal

from pydantic import Field
from pydantic_settings import SettingsConfigDict

from common.config import Section, Settings
from gateway.status.board import SourceKind


class SourceSettings(Section):
    """One ROS 2 topic the gateway reads."""

    kind: SourceKind
    topic: str = Field(min_length=1)
    type: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*/msg/[A-Za-z][A-Za-z0-9_]*$")
    reliability: Literal["best_effort", "reliable"] = "best_effort"
    durability: Literal["volatile", "transient_local"] = "volatile"
    stale_after_ms: int = Field(gt=0)
    required: bool = False
    """Whether the robot counts as degraded without this source (odometry and vision only)."""
    image_width_px: int = Field(default=1280, gt=0)
    """Width of the picture that detection boxes refer to (detections only); the messages don't tell."""
    image_height_px: int = Field(default=720, gt=0)
    """Height of the same picture."""
    max_items: int = Field(default=100, ge=1, le=1000)
    """How many detections of one picture are kept; all are counted."""


DEFAULT_SOURCES = (
    SourceSettings(
        kind=SourceKind.ODOMETRY,
        topic="/odometry/filtered",
        type="nav_msgs/msg/Odometry",
        stale_after_ms=1000,
        required=True,
    ),
    SourceSettings(
        kind=SourceKind.VISION,
        topic="/vision/perf",
        type="omniseer_msgs/msg/VisionPerfSummary",
        stale_after_ms=2000,
        required=True,
    ),
    SourceSettings(
        kind=SourceKind.DETECTIONS,
        topic="/yolo/detections",
        type="yolo_msgs/msg/DetectionArray",
        stale_after_ms=500,
    ),
    SourceSettings(
        kind=SourceKind.BATTERY,
        topic="/battery",
        type="sensor_msgs/msg/BatteryState",
        stale_after_ms=5000,
    ),
)


class GatewaySettings(Settings):
    """Everything the gateway can be told. The defaults suit the first robot."""

    model_config = SettingsConfigDict(env_prefix="GATEWAY__")

    sources: tuple[SourceSettings, ...] = DEFAULT_SOURCES
