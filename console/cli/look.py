"""One look at the robot, as `robotctl watch` shows it."""

from dataclasses import dataclass

from console.client import GatewayError, SystemStatus


@dataclass(frozen=True, slots=True)
class Look:
    """One look at the robot.

    Args:
        status: the newest that was ever received.
        trouble: why this look brought nothing new; None when it did.
        silent_ms: since the newest status came.
    """

    status: SystemStatus
    trouble: GatewayError | None
    silent_ms: int
