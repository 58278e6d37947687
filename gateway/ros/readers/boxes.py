"""What readers of detections share: which boxes are kept, and how many."""

from collections.abc import Callable, Sequence
from typing import Any

from gateway.config import SourceSettings
from gateway.ros.readers.plain import between, finite, finite_or_zero, name
from gateway.status.values import Detection, Detections


def detections(
    items: Sequence[Any], source: SourceSettings, read: Callable[[Any], Detection | None]
) -> Detections:
    """The first `max_items` objects of a picture; all are counted, those without a usable box left out."""
    kept = (read(item) for item in items[: source.max_items])
    return Detections(
        source_width_px=source.image_width_px,
        source_height_px=source.image_height_px,
        count=len(items),
        items=tuple(item for item in kept if item is not None),
    )


def detection(
    *,
    class_id: int,
    class_name: Any,
    score: Any,
    track_id: Any,
    center: Any,
    width_px: Any,
    height_px: Any,
) -> Detection | None:
    """One object; `center` has x and y. None when its box can't be drawn: not finite, or inside out."""
    x, y, width, height = finite(center.x), finite(center.y), finite(width_px), finite(height_px)
    if x is None or y is None or width is None or height is None or width < 0 or height < 0:
        return None
    return Detection(
        class_id=class_id,
        class_name=name(class_name),
        score=between(0.0, finite_or_zero(score), 1.0),
        track_id=name(track_id),
        center_x_px=x,
        center_y_px=y,
        width_px=width,
        height_px=height,
    )
