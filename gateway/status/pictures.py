"""What viewers report of the pictures that they show: how old a picture the robot is driven by. Pure.

Reports are claims of viewers that nothing proves, so little follows from them, and each only for a while.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Final

REPORT_COUNTS_S: Final = 3.0
"""How long a report counts."""
MAX_VIEWERS: Final = 64
"""Viewers whose reports are kept; beyond it the one that reported longest ago is dropped. A viewer that goes
on reporting is back with its next report, so a flood of names displaces none for long."""
LONGEST_OF_LINK_MS: Final = 5_000
"""An older picture is frozen or made up: a lower bit rate would not make it younger."""


class Delivery(Enum):
    """How a viewer takes the stream: as packets arrive, or after the SRT latency."""

    DIRECT = "direct"
    SRT_LATENCY = "SRT latency"


@dataclass(frozen=True, slots=True)
class PictureReport:
    """The picture that a viewer shows; counts are since it connected. None where the viewer does not know.

    Attributes:
        age_ms: from capture to now.
        error_ms: bound of the error of `age_ms`.
        packets_held: that waited for a missing one before them.
        packets_given_up: that never came.
        link_age_ms: `age_ms` without the time that pictures waited on the viewer's computer.
    """

    age_ms: int
    error_ms: int
    rtt_ms: int | None
    loss_percent: float | None
    packets_held: int
    packets_given_up: int
    delivery: Delivery | None
    link_age_ms: int | None = None

    @property
    def of_link_ms(self) -> int:
        """The age as far as the link may have caused it."""
        return self.age_ms if self.link_age_ms is None else self.link_age_ms


@dataclass(frozen=True, slots=True)
class Pictures:
    """All reports that count, together.

    Attributes:
        viewer_count: viewers that have one.
        worst_age_ms: the largest age; None without reports.
        link_age_ms: the same as far as it is beyond the viewers' doubt and may be caused by the link: for the
            adaptive bit rate. None if no report is of that kind.
        direct_count: viewers of these that take packets as they arrive.
        srt_latency_count: viewers of these that wait for the SRT latency.
        most_given_up: the most packets that one of them has given up; None without reports.
    """

    viewer_count: int = 0
    worst_age_ms: int | None = None
    link_age_ms: int | None = None
    direct_count: int = 0
    srt_latency_count: int = 0
    most_given_up: int | None = None


NO_PICTURES: Final = Pictures()


class PictureReports:
    """The newest report of each viewer. Used on one event loop."""

    def __init__(self) -> None:
        self._reports: dict[tuple[str, str], tuple[float, PictureReport]] = {}
        """By caller and viewer: when it came, monotonic seconds, and the report; the newest at the end."""

    def take(self, caller: str, viewer_id: str, report: PictureReport, now_s: float) -> None:
        """Takes a report; it replaces the viewer's last one."""
        self._reports.pop((caller, viewer_id), None)
        self._reports[caller, viewer_id] = now_s, report
        if len(self._reports) > MAX_VIEWERS:
            del self._reports[next(iter(self._reports))]

    def counting(self, now_s: float) -> Pictures:
        """Returns what the reports say that count at `now_s`; forgets the others."""
        while self._reports and now_s - next(iter(self._reports.values()))[0] > REPORT_COUNTS_S:
            del self._reports[next(iter(self._reports))]
        if not self._reports:
            return NO_PICTURES
        reports = [report for _, report in self._reports.values()]
        deliveries = [report.delivery for report in reports]
        of_link = [report for report in reports if report.of_link_ms <= LONGEST_OF_LINK_MS]
        return Pictures(
            viewer_count=len(reports),
            worst_age_ms=max(report.age_ms for report in reports),
            link_age_ms=max((max(0, each.of_link_ms - each.error_ms) for each in of_link), default=None),
            direct_count=deliveries.count(Delivery.DIRECT),
            srt_latency_count=deliveries.count(Delivery.SRT_LATENCY),
            most_given_up=max(report.packets_given_up for report in reports),
        )
