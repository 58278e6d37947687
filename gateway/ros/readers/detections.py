"""Detected objects: yolo_msgs/msg/DetectionArray (yolo_ros) and vision_msgs/msg/Detection2DArray."""

from collections.abc import Callable, Sequence
from typing import Any

from gateway.config import SourceSettings
from gateway.ros.readers.plain import clamp, finite, finite_or_zero, one_line
from gateway.ros.readers.registry import reads
from gateway.status.sources import DETECTIONS
from gateway.status.values import Detection, Detections

_INT32_MAX = 2**31 - 1
_INT32_DIGITS = 10


@reads("yolo_msgs/msg/DetectionArray", DETECTIONS, header_and_list=True)
def from_detection_array(message: Any, source: SourceSettings) -> Detections:
    """Returns the objects of one image."""
    return _detections(message.detections, source, _of_yolo)


@reads("vision_msgs/msg/Detection2DArray", DETECTIONS, header_and_list=True)
def from_detection2d_array(message: Any, source: SourceSettings) -> Detections:
    """Returns the objects of one image, each with the most likely of its hypotheses."""
    return _detections(message.detections, source, _of_vision_msgs)


def _of_yolo(item: Any) -> Detection | None:
    size = item.bbox.size
    return _detection((int(item.class_id), item.class_name), item.score, item, size.x, size.y)


def _of_vision_msgs(item: Any) -> Detection | None:
    hypotheses = [result.hypothesis for result in item.results]
    best = max(hypotheses, key=lambda hypothesis: finite_or_zero(hypothesis.score), default=None)
    category = _class_of(best.class_id) if best else (0, "")
    score = best.score if best else 0.0
    return _detection(category, score, item, item.bbox.size_x, item.bbox.size_y)


def _class_of(text: str) -> tuple[int, str]:
    """Returns id and name of a class: these messages hold a string, for some detectors a number."""
    if text.isascii() and text.isdigit() and len(text) <= _INT32_DIGITS and int(text) <= _INT32_MAX:
        return int(text), ""
    return 0, text


def _detections(
    items: Sequence[Any], source: SourceSettings, read: Callable[[Any], Detection | None]
) -> Detections:
    """Returns the first `max_items` objects; all are counted, those without a valid box are left out."""
    kept = (read(item) for item in items[: source.max_items])
    return Detections(
        source_width_px=source.image_width_px,
        source_height_px=source.image_height_px,
        count=len(items),
        items=tuple(item for item in kept if item is not None),
    )


def _detection(
    category: tuple[int, Any], score: Any, item: Any, width_px: Any, height_px: Any
) -> Detection | None:
    """Returns one object; None if its box is invalid: not finite, or of negative size."""
    center = item.bbox.center.position
    x, y, width, height = finite(center.x), finite(center.y), finite(width_px), finite(height_px)
    if x is None or y is None or width is None or height is None or width < 0 or height < 0:
        return None
    return Detection(
        class_id=category[0],
        class_name=one_line(category[1]),
        score=clamp(0.0, finite_or_zero(score), 1.0),
        track_id=one_line(item.id),
        center_x_px=x,
        center_y_px=y,
        width_px=width,
        height_px=height,
    )
