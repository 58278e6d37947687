"""Desired and reported state of the drive program, and what is sent to it besides."""

from dataclasses import dataclass

from gateway.links.link import ServiceLink
from gateway.status.teleop import DriveActual, DriveView
from gateway.status.values import Velocity

DriveReport = DriveActual
"""The drive program reports all that operators may see."""


@dataclass(frozen=True, slots=True)
class DriveSpec:
    """What operators request of the drive program."""

    enabled: bool

    def __str__(self) -> str:
        return "enabled" if self.enabled else "disabled"


DriveLink = ServiceLink[DriveSpec, DriveReport, DriveView]


@dataclass(frozen=True, slots=True)
class DriveCommand:
    """A driver's command; instants are ns of CLOCK_MONOTONIC, 0 for none.

    Attributes:
        valid_until_ns: no motion by it afterwards.
        echo_ns: the newest instant of the robot that the driver has received.
        picture_ns: capture of the picture that the driver sees.
    """

    sequence: int
    held: bool
    velocity: Velocity
    valid_until_ns: int
    echo_ns: int = 0
    picture_ns: int = 0
