"""std_msgs/msg/String: what the robot is about, in its own words."""

from typing import Any

from gateway.config import SourceSettings
from gateway.ros.readers.plain import name
from gateway.ros.readers.registry import reads
from gateway.status.board import SourceKind
from gateway.status.values import Mode


@reads("std_msgs/msg/String", SourceKind.MODE)
def from_string(message: Any, source: SourceSettings) -> Mode | None:
    """The mode; None when the text is empty, which tells none."""
    mode = name(message.data).strip()
    return Mode(mode) if mode else None
