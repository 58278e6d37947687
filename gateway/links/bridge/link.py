"""Watches the bridge, and keeps what it reports."""

import time
from collections.abc import Callable
from typing import Final

from gateway.links.bridge.wire import BridgeClient
from gateway.links.watch import ServiceWatch, WatchConnector
from gateway.status.cloud import BridgeReport, CloudView

_SILENCE_S: Final = 2.4
"""The bridge reports at least every second; operators see within 2.5 s that it does not."""


class BridgeLink(ServiceWatch[BridgeClient, BridgeReport]):
    """The link to the bridge.

    Args:
        name: of the bridge and where it listens, for the log.
        connector: opens the connections.
        clock: monotonic seconds.

    Attributes:
        view: what clients may know; a new object after each report and loss.
    """

    def __init__(
        self,
        name: str,
        connector: WatchConnector[BridgeClient],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(name, connector, silence_s=_SILENCE_S)
        self._clock = clock
        self.view = CloudView("not connected yet", clock())

    @property
    def run_id(self) -> str:
        """ID of the bridge's run; empty while it does not answer."""
        return self.view.newest.instance_id if self.view.newest else ""

    def _record(self, report: BridgeReport) -> bool:
        before = self.view
        self.view = before.reported(report, self._clock())
        return bool(before.error)

    def _record_loss(self, reason: str) -> bool:
        before = self.view
        self.view = before.lost(reason, self._clock())
        return not before.error
