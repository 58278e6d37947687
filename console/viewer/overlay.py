"""Detections over the video: which boxes to draw, and where."""

import math
from dataclasses import dataclass

from console.client.results import Detection, Detections, Freshness
from console.viewer.geometry import Box, on_frame


@dataclass(frozen=True, slots=True)
class Mark:
    """A box to draw.

    Args:
        box: in pixels of the window.
        label: text beside it; may be empty.
    """

    box: Box
    label: str


def marks(found: Detections | None, frame: Box) -> list[Mark]:
    """Returns the boxes to draw on a frame that is shown at `frame`; none if the detections are stale."""
    if not found or found.freshness is not Freshness.FRESH:
        return []
    if not found.source_width_px or not found.source_height_px:
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
