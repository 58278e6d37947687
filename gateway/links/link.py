"""Links to services that follow a desired state: applies it whenever the service does not have it."""

import logging
import time
from collections.abc import Coroutine
from typing import Any, Generic, Protocol, TypeAlias, TypeVar

from common import request_id
from common.backoff import Backoff
from gateway.links.reconciler import Desired, Reconciler, Report, ReportT, SpecT, ViewT
from gateway.links.watch import (
    FIRST_PAUSE_S,
    LONGEST_PAUSE_S,
    LinkLostError,
    Reporter,
    ServiceWatch,
    WatchConnector,
    reply_within,
)

_log = logging.getLogger(__name__)
ReportT_co = TypeVar("ReportT_co", bound=Report, covariant=True)


class RefusedError(Exception):
    """The service refuses the desired state, in its own words."""


class ServiceClient(Reporter[ReportT_co], Protocol[SpecT, ReportT_co]):
    """One connection to a service that applies a desired state."""

    async def apply(self, desired: Desired[SpecT]) -> ReportT_co:
        """Returns the actual state with `desired` applied, though it may not be reached yet.

        Raises:
            RefusedError: the service refuses it.
            LinkLostError: the connection has broken.
        """


Connector: TypeAlias = WatchConnector[ServiceClient[SpecT, ReportT]]
"""Opens connections to such a service."""


class ServiceLink(ServiceWatch[ServiceClient[SpecT, ReportT], ReportT], Generic[SpecT, ReportT, ViewT]):
    """Link to one service that follows a desired state, and runs on when the gateway ends.

    Args:
        name: of the service and where it listens, for the log.
        silence_s: a service without a report for so long is gone.
        apply_deadline_s: limit of one request; applying takes a healthy service milliseconds.

    Attributes:
        changes: wakes on each request, report, refusal and loss.
    """

    def __init__(
        self,
        name: str,
        connector: Connector[SpecT, ReportT],
        reconciler: Reconciler[SpecT, ReportT, ViewT],
        *,
        silence_s: float = 2.5,
        apply_deadline_s: float = 2.0,
    ) -> None:
        super().__init__(name, connector, silence_s=silence_s)
        self._reconciler = reconciler
        self._apply_deadline_s = apply_deadline_s

    @property
    def view(self) -> ViewT:
        """What clients may know of the service, from memory."""
        return self._reconciler.view

    @property
    def desired(self) -> Desired[SpecT]:
        """Newest desired state."""
        return self._reconciler.desired

    @property
    def refusal(self) -> str | None:
        """Why the service refuses the desired state; None if it does not."""
        return self._reconciler.refusal

    def request(self, spec: SpecT) -> Desired[SpecT]:
        """Replaces the desired state; returns without waiting for the service."""
        desired = self._reconciler.request(spec, request_id.current())
        _log.info("%s: revision %d requested: %s", self._name, desired.revision, spec)
        self.changes.notify_all()
        return desired

    def settled(self, desired: Desired[SpecT]) -> bool:
        """Whether `desired` was reached, failed or replaced."""
        return self._reconciler.settled(desired)

    async def wait_until_settled(self, desired: Desired[SpecT], timeout_s: float) -> bool:
        """Returns whether `desired` has settled before the timeout."""
        return await self.changes.wait_until(lambda: self.settled(desired), timeout_s)

    def _record(self, report: ReportT) -> bool:
        return self._reconciler.take_report(report, time.monotonic())

    def _record_loss(self, reason: str) -> bool:
        return self._reconciler.take_loss(reason)

    def _jobs(self, client: ServiceClient[SpecT, ReportT]) -> list[Coroutine[Any, Any, None]]:
        return [self._listen(client), self._keep_applied(client)]

    async def _pause(self, pause_s: float) -> None:
        """Waits; a new request cuts it short."""
        revision = self.desired.revision
        await self.changes.wait_until(lambda: self.desired.revision != revision, pause_s)

    async def _keep_applied(self, client: ServiceClient[SpecT, ReportT]) -> None:
        backoff = Backoff(FIRST_PAUSE_S, LONGEST_PAUSE_S)
        while True:
            await self.changes.wait_until(lambda: self._reconciler.pending() is not None)
            if desired := self._reconciler.pending():
                await self._apply(client, desired)
            # Normally applied by now. Two gateways at one service would overwrite each other without a pause.
            if self._reconciler.pending():
                await self._pause(backoff.next_s())
            else:
                backoff.reset()

    async def _apply(self, client: ServiceClient[SpecT, ReportT], desired: Desired[SpecT]) -> None:
        try:
            report = await reply_within(self._apply_deadline_s, client.apply(desired))
        except RefusedError as error:
            _log.error("%s refuses revision %d: %s", self._name, desired.revision, error)
            self._reconciler.take_refusal(desired, str(error))
            self.changes.notify_all()
            return
        if report is None:
            raise LinkLostError(f"no answer to a request for {self._apply_deadline_s:g} s")
        self._take_report(report)
