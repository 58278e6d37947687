"""Detections and events, as an overlay on the video shows them."""

from dataclasses import dataclass

from console.client.results.sample import Sample
from console.client.results.status import SystemStatus


@dataclass(frozen=True, slots=True, kw_only=True)
class Detection:
    """One detected object; its box in pixels of the source frame: x right, y down, origin upper left."""

    class_id: int
    class_name: str
    """Empty where the robot does not name its classes."""
    score: float
    """Confidence, 0 to 1."""
    track_id: str
    """Constant for one object from frame to frame. Empty where objects are not tracked."""
    center_x_px: float
    center_y_px: float
    width_px: float
    height_px: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Detections(Sample):
    """The newest detections. Do not draw them when they are stale."""

    source_width_px: int | None
    source_height_px: int | None
    count: int | None
    """Number of detected objects; `items` has fewer where the gateway capped the list."""
    items: tuple[Detection, ...]
    """Empty when not available."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatorEvent:
    """An event in short form."""

    sequence: int
    """Number of the event since the gateway started, from 1."""
    age_ms: int
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class OverlaySnapshot:
    """Status, detections and the newest events, all of one instant."""

    status: SystemStatus
    detections: Detections
    events: tuple[OperatorEvent, ...]
    """The newest 8, oldest first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchedStatus:
    """A status with its time on the robot's monotonic clock and, on request, the detections of that time."""

    status: SystemStatus
    monotonic_ns: int | None
    """None where an older gateway was polled."""
    detections: Detections | None = None
    """None where they were not requested, or the gateway is too old to send them."""
