"""Faults of the connection to the robot's fleet. None of them keeps the robot from working."""

from collections.abc import Iterator
from typing import Final

from gateway.status.cloud import OUTBOX_FULL, BridgeReport, CloudState, CloudView, RecordingCopyState
from gateway.status.fault import Condition, Severity

SERVICE: Final = "cloud.service"
OFFLINE: Final = "cloud.offline"
REFUSED: Final = "cloud.refused"
OUTBOX: Final = "cloud.outbox"
UPLOAD: Final = "cloud.upload"
OWN: Final = "fleet"
"""The component of all of them: what happens at the hub makes no incident on the robot."""
DROPPING_FOR_S: Final = 60.0
"""So long after the newest dropping of events the outbox counts as full, whatever its size."""


def cloud_faults(
    cloud: CloudView | None, now_s: float, *, offline_after_s: float, settled: bool
) -> Iterator[Condition]:
    """Yields the present conditions.

    Args:
        cloud: as the bridge's link sees it; None where the robot is not set up for a fleet.
        now_s: monotonic seconds.
        offline_after_s: how long the hub may be away without a fault.
        settled: whether the startup grace has elapsed.
    """
    if cloud is None:
        return
    report = cloud.newest
    if report is None:
        if settled:
            yield Condition(
                SERVICE,
                Severity.WARNING,
                OWN,
                "the bridge does not answer: nothing is sent to the fleet",
                "Start or restart robot-bridge on the robot; the gateway connects by itself",
            )
        return
    status = report.status
    if status.state is CloudState.FAULTED:
        yield Condition(
            SERVICE,
            Severity.ERROR,
            OWN,
            _because("the bridge can't work: nothing is sent to the fleet", status.last_error),
            "Type on the robot: robot-bridge doctor",
        )
    if status.state is CloudState.REFUSED:
        yield Condition(
            REFUSED,
            Severity.ERROR,
            OWN,
            _because("the fleet's hub refuses this robot's credential", status.last_error),
            "Have the robot enrolled again where the hub is administered: robot-bridge enroll NAME",
        )
    without_s = 0.0 if cloud.without_hub_s is None else now_s - cloud.without_hub_s
    if status.state is CloudState.OFFLINE and without_s >= offline_after_s:
        yield Condition(
            OFFLINE,
            Severity.WARNING,
            OWN,
            _because("the fleet's hub has not been reached for a while", status.last_error),
            "Check the robot's network; type on the robot: robot-bridge doctor",
        )
    if _drops(cloud, report, now_s):
        yield Condition(
            OUTBOX,
            Severity.WARNING,
            OWN,
            "events for the fleet are dropped: the outbox is full, or its disk takes no data",
            "Check the robot's network and its disk; outbox.max_bytes of the bridge sets the limit",
        )
    failed = [each for each in report.copies if each.copy.state is RecordingCopyState.FAILED]
    if failed:
        yield Condition(
            UPLOAD,
            Severity.WARNING,
            OWN,
            _because("recordings can't be copied to the fleet's store", failed[0].copy.reason),
            "The robot tries again by itself; to see which, type: robotctl record list",
        )


def _drops(cloud: CloudView, report: BridgeReport, now_s: float) -> bool:
    if cloud.dropped_s is None:
        return False
    status = report.status
    full = status.outbox_bytes >= OUTBOX_FULL * status.outbox_max_bytes
    return full or now_s - cloud.dropped_s < DROPPING_FOR_S


def _because(sentence: str, reason: str) -> str:
    return f"{sentence} ({reason})" if reason else sentence
