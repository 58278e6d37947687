"""The robot's clocks as they were told."""

from dataclasses import dataclass

from console.client.results.status import SystemStatus


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotTime:
    """Both clocks of the robot's computer, read together."""

    monotonic_ns: int
    wall_clock_unix_ns: int
    boot_id: str | None
    """Another one after each start of the computer, where its monotonic clock begins anew."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchedStatus:
    """A status and its instant on the robot's monotonic clock."""

    status: SystemStatus
    monotonic_ns: int | None
    """None of a gateway that had to be asked: it is older than the stream."""
