"""yolo_msgs/msg/DetectionArray, of yolo_ros."""

from typing import Any

from gateway.config import SourceSettings
from gateway.ros.readers.boxes import detection, detections
from gateway.ros.readers.registry import reads
from gateway.status.board import SourceKind
from gateway.status.values import Detection, Detections


@reads("yolo_msgs/msg/DetectionArray", SourceKind.DETECTIONS, header_and_list=True)
def from_detection_array(message: Any, source: SourceSettings) -> Detections:
    """All objects of one picture."""
    return detections(message.detections, source, _one)


def _one(item: Any) -> Detection | None:
    return detection(
        class_id=int(item.class_id),
        class_name=item.class_name,
        score=item.score,
        track_id=item.id,
        center=item.bbox.center.position,
        width_px=item.bbox.size.x,
        height_px=item.bbox.size.y,
    )
