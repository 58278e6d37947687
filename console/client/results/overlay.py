"""What a screen draws over the picture."""

from dataclasses import dataclass

from console.client.results.sample import Sample
from console.client.results.status import SystemStatus


@dataclass(frozen=True, slots=True, kw_only=True)
class Detection:
    """One object; its box in pixels of the source image: x right, y down, origin upper left."""

    class_id: int
    class_name: str
    """Empty when the robot gives none."""
    score: float
    """Confidence, 0 to 1."""
    track_id: str
    """The same object keeps the same id from image to image. Empty when objects are not tracked."""
    center_x_px: float
    center_y_px: float
    width_px: float
    height_px: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Detections(Sample):
    """The newest set of detections. Don't draw it when it is stale."""

    source_width_px: int | None
    source_height_px: int | None
    count: int | None
    """How many objects there were; `items` holds fewer when the gateway capped the list."""
    items: tuple[Detection, ...]
    """Empty when not available."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatorEvent:
    """Something happened that an operator should know."""

    sequence: int
    """Counts up by one from 1 since the gateway started."""
    age_ms: int
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class OverlaySnapshot:
    """Status, detections and the newest events, at one instant."""

    status: SystemStatus
    detections: Detections
    events: tuple[OperatorEvent, ...]
    """The newest 8, oldest first."""
