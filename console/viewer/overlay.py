"""The detections to be drawn over the picture: which, where, and whether still."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, TypeAlias

from console.client.results import Detection, Detections
from console.viewer.geometry import Box, on_picture

_SILENT_AFTER_S: Final = 1.0
"""Without news from the robot for this long, nobody knows whether the boxes are still true."""


@dataclass(frozen=True, slots=True)
class Overlay:
    """The newest detections.

    Args:
        detections: as the robot told them.
        received_s: when, on `time.monotonic()`.
    """

    detections: Detections
    received_s: float


OverlaySource: TypeAlias = Callable[[], Overlay | None]
"""Gives the newest; called by the thread that paints, so it must return at once."""


@dataclass(frozen=True, slots=True)
class Mark:
    """A box to draw.

    Args:
        box: in pixels of the window.
        label: what stands beside it; may be empty.
    """

    box: Box
    label: str


def marks(overlay: Overlay | None, picture: Box, now_s: float) -> list[Mark]:
    """What to draw on a picture that is shown at `picture`; nothing when the detections are stale."""
    if overlay is None or now_s - overlay.received_s > _SILENT_AFTER_S:
        return []
    found = overlay.detections
    if not found.available or found.stale or not found.source_width_px or not found.source_height_px:
        return []
    drawn = []
    for item in found.items:
        box = on_picture(_box(item), found.source_width_px, found.source_height_px, picture)
        if box:
            drawn.append(Mark(box, _label(item)))
    return drawn


def _box(item: Detection) -> Box:
    return Box(
        item.center_x_px - item.width_px / 2,
        item.center_y_px - item.height_px / 2,
        item.width_px,
        item.height_px,
    )


def _label(item: Detection) -> str:
    name = item.class_name or f"class {item.class_id}"
    track = f" #{item.track_id}" if item.track_id else ""
    score = f" {item.score:.0%}" if math.isfinite(item.score) else ""
    return f"{name}{track}{score}"
