"""omniseer_msgs/msg/VisionPerfSummary: what the vision process says of itself."""

from typing import Any

from gateway.config import SourceSettings
from gateway.ros.readers.plain import finite_or_zero
from gateway.ros.readers.registry import reads
from gateway.status.board import SourceKind
from gateway.status.values import Vision


@reads("omniseer_msgs/msg/VisionPerfSummary", SourceKind.VISION)
def from_vision_perf(message: Any, source: SourceSettings) -> Vision:
    """Rates, the newest inference and the error counts. A rate that is not finite counts as none: 0."""
    return Vision(
        producer_fps=finite_or_zero(message.producer_fps),
        consumer_fps=finite_or_zero(message.consumer_fps),
        last_infer_ms=finite_or_zero(message.last_infer_ms),
        infer_error_count=int(message.infer_error_count),
        capture_fatal_error_count=int(message.capture_fatal_error_count),
    )
