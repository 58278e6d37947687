"""The board: the newest value of every source, handed over from the threads that read to the asyncio loop.

A slot is written by one reference assignment and read by one reference read, which CPython makes atomic;
there is no lock, no queue and nobody waits. An older value is simply gone.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from gateway.status.values import (
    Battery,
    CommandSource,
    Compute,
    Detections,
    Diagnostics,
    Mode,
    Network,
    Odometry,
    Received,
    Velocity,
    Vision,
)


class SourceKind(Enum):
    """What a source tells about the robot."""

    ODOMETRY = "odometry"
    VISION = "vision"
    DETECTIONS = "detections"
    BATTERY = "battery"
    DIAGNOSTICS = "diagnostics"
    MODE = "mode"
    EFFECTIVE_COMMAND = "effective_command"
    """What the robot's command mux lets through."""
    MUX_INPUT = "mux_input"
    """What one of those who may command asks for; several, told apart by their CommandSource."""


@dataclass(frozen=True, slots=True)
class Presence:
    """Who offers a source on the robot's message bus at this moment.

    Attributes:
        offered_by: how many publishers there are, of whatever type.
        qos_mismatch: how each of them excludes us by its quality of service, in words; else empty.
        wrong_type: whether each of them publishes another type than configured.
    """

    offered_by: int
    qos_mismatch: str = ""
    wrong_type: bool = False


@dataclass(slots=True)
class Board:
    """One slot per source; None until the first value arrives. Each slot has one writer."""

    odometry: Received[Odometry] | None = None
    vision: Received[Vision] | None = None
    detections: Received[Detections] | None = None
    battery: Received[Battery] | None = None
    """The traction battery, as the robot's message bus tells it."""
    diagnostics: Received[Diagnostics] | None = None
    mode: Received[Mode] | None = None
    effective_command: Received[Velocity] | None = None
    mux_inputs: Mapping[CommandSource, Received[Velocity]] = field(default_factory=dict)
    """The newest command of each input that has spoken; replaced as a whole, never changed."""
    compute: Received[Compute] | None = None
    network: Received[Network] | None = None
    onboard_battery: Received[Battery] | None = None
    """The computer's own battery, as its operating system tells it."""
    presence: dict[str, Presence] = field(default_factory=dict)
    """Who offers each source, by its name ("odometry", "mux_input.keyboard")."""
    unusable: dict[str, str] = field(default_factory=dict)
    """Sources by name that can't deliver (message type not installed), with the reason for the log."""
