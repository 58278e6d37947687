"""Detections over the video: which boxes to draw, where, and until when."""

import math
from dataclasses import dataclass
from typing import Final

from console.client.results import Detection, Detections
from console.viewer.geometry import Box, on_frame

_SILENT_AFTER_S: Final = 1.0
"""Silence of the robot after which its boxes are not drawn: they may be wrong by then."""


@dataclass(frozen=True, slots=True)
class Overlay:
    """The latest detections.

    Args:
        detections: as the robot reported them.
        heard_s: when the robot last answered, on `time.monotonic()`: they held then.
    """

    detections: Detections
    heard_s: float


@dataclass(frozen=True, slots=True)
class Mark:
    """A box to draw.

    Args:
        box: in pixels of the window.
        label: text beside it; may be empty.
    """

    box: Box
    label: str


def marks(overlay: Overlay | None, frame: Box, now_s: float) -> list[Mark]:
    """Returns the boxes to draw on a frame that is shown at `frame`; none if the detections are stale."""
    if overlay is None or now_s - overlay.heard_s > _SILENT_AFTER_S:
        return []
    found = overlay.detections
    if not found.available or found.stale or not found.source_width_px or not found.source_height_px:
        return []
    drawn = []
    for item in found.items:
        left, top = item.center_x_px - item.width_px / 2, item.center_y_px - item.height_px / 2
        box = Box(left, top, item.width_px, item.height_px)
        if visible := on_frame(box, found.source_width_px, found.source_height_px, frame):
            drawn.append(Mark(visible, _label(item)))
    return drawn


def _label(item: Detection) -> str:
    name = item.class_name or f"class {item.class_id}"
    track = f" #{item.track_id}" if item.track_id else ""
    score = f" {item.score:.0%}" if math.isfinite(item.score) else ""
    return f"{name}{track}{score}"
