"""Detections and events, from the contract's messages."""

from console.client.mapping.status import system_status
from console.client.mapping.values import number, sample, when
from console.client.results import Detection, Detections, OperatorEvent, OverlaySnapshot
from omniseer.gateway.v1 import overlay_pb2 as wire


def overlay_snapshot(message: wire.OverlaySnapshot) -> OverlaySnapshot:
    """Returns status, detections and events of one instant."""
    return OverlaySnapshot(
        status=system_status(message.status),
        detections=detections(message.detections),
        events=tuple(
            OperatorEvent(sequence=event.sequence, age_ms=event.age_ms, message=event.message)
            for event in message.events
        ),
    )


def detections(message: wire.DetectionOverlayStatus) -> Detections:
    """Returns the newest detections."""
    here = message.available
    return Detections(
        **sample(message),
        source_width_px=when(here, message.source_width_px),
        source_height_px=when(here, message.source_height_px),
        count=when(here, message.detection_count),
        items=tuple(_detection(item) for item in message.detections) if here else (),
    )


def _detection(message: wire.OverlayDetection) -> Detection:
    return Detection(
        class_id=message.class_id,
        class_name=message.class_name,
        score=number(message.score),
        track_id=message.track_id,
        center_x_px=number(message.bbox_center_x_px),
        center_y_px=number(message.bbox_center_y_px),
        width_px=number(message.bbox_width_px),
        height_px=number(message.bbox_height_px),
    )
