"""Faults of driving."""

from collections.abc import Iterator
from typing import Final

from gateway.status.fault import Condition, Severity
from gateway.status.teleop import TeleopView

UNREACHABLE: Final = "drive.unreachable"
STOPPED: Final = "drive.stopped"
BASE: Final = "drive.base"
_COMPONENT: Final = "drive"


def driving_faults(teleop: TeleopView | None, *, settled: bool) -> Iterator[Condition]:
    """Yields the present conditions.

    Args:
        teleop: driving; None where the robot is not set up for it.
        settled: whether the startup grace has elapsed.
    """
    if teleop is None:
        return
    drive = teleop.drive
    if not drive.reachable:
        if settled:
            yield Condition(
                UNREACHABLE,
                Severity.ERROR if teleop.holder else Severity.WARNING,
                _COMPONENT,
                f"the drive program does not answer: no one can drive ({drive.error})",
                "Start or restart robot-drive on the robot; the gateway connects by itself",
            )
        return
    if stop := drive.stop:
        why = f": {stop.reason}" if stop.reason else ""
        yield Condition(
            STOPPED,
            Severity.WARNING,
            _COMPONENT,
            f"the robot is stopped by {stop.by}{why}",
            f"When it may move again, type: robotctl reset-stop {stop.stop_id}",
        )
    if settled and drive.actual and drive.actual.problems:
        yield Condition(
            BASE,
            Severity.WARNING,
            _COMPONENT,
            f"the robot can't be driven: {'; '.join(drive.actual.problems)}",
            "Type on the robot: robot-drive doctor",
        )
