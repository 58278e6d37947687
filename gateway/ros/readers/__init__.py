"""One reader per message type: it takes a message and gives the frozen value the gateway knows.

Readers go by attribute and import no message package, so a robot without one of them costs nothing. To read
a type of your own, write one function in a module of this package and name the module below:

    @reads("my_msgs/msg/WheelSpeeds", SourceKind.ODOMETRY)
    def wheel_speeds(message: Any, source: SourceSettings) -> Odometry | None:
        return planar(message.forward, 0.0, message.turn)
"""

from gateway.ros.readers import (
    battery,
    commands,
    detection2d,
    diagnostics,
    mode,
    odometry,
    vision_perf,
    yolo,
)
from gateway.ros.readers.registry import Reader, is_header_and_list, reader_for

__all__ = [
    "Reader",
    "battery",
    "commands",
    "detection2d",
    "diagnostics",
    "is_header_and_list",
    "mode",
    "odometry",
    "reader_for",
    "vision_perf",
    "yolo",
]
