"""Faults of recording."""

from collections.abc import Iterator
from typing import Final

from gateway.status.fault import Condition, Severity
from gateway.status.recording import RecorderState, RecorderView

SERVICE: Final = "recording.service"
DISK: Final = "recording.disk"
LOSING: Final = "recording.losing"
OWN: Final = "recording"
"""The component of all of them: the recorder makes no incident of its own faults."""
LOSING_FOR_S: Final = 10.0
"""So long after the newest loss the recorder counts as losing messages."""


def recording_faults(recorder: RecorderView | None, now_s: float, *, settled: bool) -> Iterator[Condition]:
    """Yields the present conditions.

    Args:
        recorder: as its link sees it; None where the robot is not set up for recording.
        now_s: monotonic seconds.
        settled: whether the startup grace has elapsed.
    """
    if recorder is None:
        return
    if not recorder.reachable or recorder.report is None:
        if settled:
            yield Condition(
                SERVICE,
                Severity.WARNING,
                OWN,
                "the recorder does not answer: recordings can't be started, stopped or copied",
                "Start or restart robot-recorder on the robot; the gateway connects by itself",
            )
        return
    report = recorder.report.value
    if report.status.state is RecorderState.FAULTED:
        why = f": {report.status.last_error}" if report.status.last_error else ""
        yield Condition(
            DISK,
            Severity.ERROR,
            OWN,
            f"nothing can be recorded{why}",
            "Check the robot's disk; type on the robot: robot-recorder doctor",
        )
    elif report.disk_short:
        yield Condition(
            DISK,
            Severity.WARNING,
            OWN,
            "the disk for recordings is nearly full",
            "Copy recordings to this computer and delete them: robotctl record list",
        )
    if recorder.lost_s is not None and now_s - recorder.lost_s < LOSING_FOR_S:
        yield Condition(
            LOSING,
            Severity.WARNING,
            OWN,
            "messages are missing from what is recorded",
            "Record fewer topics, or check the load of the robot and the speed of its disk",
        )
