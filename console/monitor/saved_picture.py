"""What is saved with a picture: the robot's status of the same moment. Pure."""

from collections.abc import Mapping
from datetime import datetime
from typing import Any, Final

from common.plain_name import plain_name
from console.monitor.monitor_state import MonitorState
from console.presentation.json_form import json_form
from console.presentation.picture_age import PictureAge

_LONGEST_NAME: Final = 63


def file_stem(robot: str, at: datetime) -> str:
    """Returns the name of a file without its ending; nothing of a robot's name can lead elsewhere."""
    return f"{plain_name(robot, _LONGEST_NAME, also='_')}-{at:%Y%m%d-%H%M%S}-{at.microsecond // 1000:03}"


def picture_record(
    state: MonitorState, now_s: float, at: datetime, size: tuple[int, int], age: PictureAge | None
) -> Mapping[str, Any]:
    """Returns the JSON document of a saved picture.

    Args:
        state: the latest one.
        now_s: on the monotonic clock.
        at: when it was saved.
        size: width and height of the picture in pixels.
        age: of the picture; None while it is unknown.
    """
    snapshot = state.snapshot
    return {
        "saved_at": at.isoformat(timespec="milliseconds"),
        "picture": {"width_px": size[0], "height_px": size[1], "age": json_form(age)},
        "connected": not state.outdated(now_s),
        "status_age_ms": state.snapshot_age_ms(now_s) if snapshot else None,
        "status": json_form(snapshot.status) if snapshot else None,
        "detections": json_form(snapshot.detections) if snapshot else None,
    }
