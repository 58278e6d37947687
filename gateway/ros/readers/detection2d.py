"""vision_msgs/msg/Detection2DArray: each object comes with everything it may be; the likeliest counts."""

from typing import Any

from gateway.config import SourceSettings
from gateway.ros.readers.boxes import detection, detections
from gateway.ros.readers.plain import finite_or_zero
from gateway.ros.readers.registry import reads
from gateway.status.board import SourceKind
from gateway.status.values import Detection, Detections

_INT32_MAX = 2**31 - 1
_INT32_DIGITS = 10


@reads("vision_msgs/msg/Detection2DArray", SourceKind.DETECTIONS, header_and_list=True)
def from_detection2d_array(message: Any, source: SourceSettings) -> Detections:
    """All objects of one picture."""
    return detections(message.detections, source, _one)


def _one(item: Any) -> Detection | None:
    hypotheses = [result.hypothesis for result in item.results]
    best = max(hypotheses, key=lambda hypothesis: finite_or_zero(hypothesis.score), default=None)
    class_id, class_name = _class_of(best.class_id) if best else (0, "")
    return detection(
        class_id=class_id,
        class_name=class_name,
        score=best.score if best else 0.0,
        track_id=item.id,
        center=item.bbox.center.position,
        width_px=item.bbox.size_x,
        height_px=item.bbox.size_y,
    )


def _class_of(text: str) -> tuple[int, str]:
    """These messages name a class by a string: some detectors write a number there, others a word."""
    if text.isascii() and text.isdigit() and len(text) <= _INT32_DIGITS and int(text) <= _INT32_MAX:
        return int(text), ""
    return 0, text
