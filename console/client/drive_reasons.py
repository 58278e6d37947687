"""Why the robot does not move, for people."""

from collections.abc import Sequence
from typing import Final

from console.client.results import DriveInhibit, StopLatch


def rest_reasons(
    stop: StopLatch | None, inhibits: Sequence[DriveInhibit], problems: Sequence[str] = ()
) -> str:
    """Returns why the robot does not move, for people; empty where there is no reason."""
    if stop:
        return f"it is stopped {stopped_by(stop)} (stop {stop.stop_id})"
    return "; ".join(dict.fromkeys([*(SENTENCES[each] for each in inhibits), *problems]))


def stopped_by(stop: StopLatch) -> str:
    """Returns who has stopped the robot, and why, for people: by anna: a child."""
    return f"by {stop.by}: {stop.reason}" if stop.reason else f"by {stop.by}"


SENTENCES: Final = {
    DriveInhibit.UNKNOWN: "the robot gives a reason that this program does not know",
    DriveInhibit.COMMAND_LATE: "commands arrive too late",
    DriveInhibit.LOOP_LATE: "the robot's states arrive too late",
    DriveInhibit.PICTURE_MISSING: "there is no picture",
    DriveInhibit.PICTURE_STALE: "the picture is too old",
    DriveInhibit.ROBOT_STOP: "the robot's own stop is active",
    DriveInhibit.BASE_ABSENT: "nothing on the robot takes the velocity commands",
    DriveInhibit.OUTRANKED: "another source of commands has priority on the robot",
    DriveInhibit.DRIVE_LOST: "the robot's drive program does not answer",
    DriveInhibit.ACCESS_ENDED: "the driver's access has ended",
}
"""Each reason for people. Total: a test checks it."""
