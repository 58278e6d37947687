"""The board: the newest value of every source, handed over from the ROS thread to the asyncio loop.

A slot is written by one reference assignment and read by one reference read, which CPython makes atomic;
there is no lock, no queue and nobody waits. An older value is simply gone.
"""

from dataclasses import dataclass, field
from enum import Enum

from gateway.status.values import Battery, Detections, Odometry, Received, Vision


class SourceKind(Enum):
    """What a source tells about the robot."""

    ODOMETRY = "odometry"
    VISION = "vision"
    DETECTIONS = "detections"
    BATTERY = "battery"


@dataclass(slots=True)
class Board:
    """One slot per kind of source; None until the first value arrives."""

    odometry: Received[Odometry] | None = None
    vision: Received[Vision] | None = None
    detections: Received[Detections] | None = None
    battery: Received[Battery] | None = None
    unusable: dict[SourceKind, str] = field(default_factory=dict)
    """Sources that can't deliver (message type not installed), with the reason for a person."""
