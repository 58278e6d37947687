"""Watches the recorder, and keeps what it reports."""

import time
from collections.abc import Callable

from gateway.links.recorder.wire import RecorderClient
from gateway.links.watch import ServiceWatch, WatchConnector
from gateway.status.recording import RecorderReport, RecorderView
from gateway.status.values import Received


class RecorderLink(ServiceWatch[RecorderClient, RecorderReport]):
    """The link to the recorder.

    Args:
        name: of the recorder and where it listens, for the log.
        connector: opens the connections.
        clock: monotonic seconds.

    Attributes:
        view: what clients may know; a new object after each report and loss.
    """

    def __init__(
        self,
        name: str,
        connector: WatchConnector[RecorderClient],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(name, connector)
        self._clock = clock
        self.view = RecorderView("not connected yet")

    def _record(self, report: RecorderReport) -> bool:
        before, now_s = self.view, self._clock()
        last = before.report.value if before.report else None
        loses = last is not None and last.instance_id == report.instance_id and report.lacks_more_than(last)
        self.view = RecorderView("", Received(report, now_s), now_s if loses else before.lost_s)
        return bool(before.error)

    def _record_loss(self, reason: str) -> bool:
        before = self.view
        self.view = RecorderView(reason, before.report, before.lost_s)
        return not before.error
