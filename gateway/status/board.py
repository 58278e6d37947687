"""The board: the newest value of every source, handed over from the threads that read to the asyncio loop.

A slot is written by one reference assignment and read by one reference read, which CPython makes atomic;
there is no lock, no queue and nobody waits. An older value is simply gone.
"""

from dataclasses import dataclass, field
from enum import Enum

from gateway.status.values import Battery, Compute, Detections, Network, Odometry, Received, Vision


class SourceKind(Enum):
    """What a source tells about the robot."""

    ODOMETRY = "odometry"
    VISION = "vision"
    DETECTIONS = "detections"
    BATTERY = "battery"


@dataclass(slots=True)
class Board:
    """One slot per source; None until the first value arrives. Each slot has one writer."""

    odometry: Received[Odometry] | None = None
    vision: Received[Vision] | None = None
    detections: Received[Detections] | None = None
    battery: Received[Battery] | None = None
    """The traction battery, as the robot's message bus tells it."""
    compute: Received[Compute] | None = None
    network: Received[Network] | None = None
    onboard_battery: Received[Battery] | None = None
    """The computer's own battery, as its operating system tells it."""
    unusable: dict[SourceKind, str] = field(default_factory=dict)
    """Sources that can't deliver (message type not installed), with the reason for a person."""
