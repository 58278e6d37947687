"""Keeps the connection to a service: applies the desired state, takes reports, reconnects with backoff."""

import asyncio
import logging
import time
from collections.abc import AsyncIterator, Awaitable, Coroutine
from contextlib import AbstractAsyncContextManager
from typing import Any, Final, Generic, NoReturn, Protocol, TypeVar

from common import request_id
from common.backoff import Backoff
from common.broadcast import Broadcast
from gateway.links.reconciler import Desired, Reconciler, Report, ReportT, SpecT, ViewT

_log = logging.getLogger(__name__)
ResultT = TypeVar("ResultT")
ReportT_co = TypeVar("ReportT_co", bound=Report, covariant=True)

FIRST_PAUSE_S: Final = 0.1
LONGEST_PAUSE_S: Final = 1.0


class LinkLostError(Exception):
    """The connection has failed, or the service breaks its protocol.

    Args:
        reason: for people, in the status.
        detail: for the log; empty if there is no more to say.
    """

    def __init__(self, reason: str, detail: str = "") -> None:
        super().__init__(reason)
        self.reason = reason
        self.detail = detail or reason


class RefusedError(Exception):
    """The service refuses the desired state, in its own words."""


class ServiceClient(Protocol[SpecT, ReportT_co]):
    """One connection to a service. Both methods raise LinkLostError when it breaks."""

    def reports(self) -> AsyncIterator[ReportT_co]:
        """Yields the actual state now, on every change, and often enough as a sign of life."""

    async def apply(self, desired: Desired[SpecT]) -> ReportT_co:
        """Returns the actual state with `desired` applied, though it may not be reached yet.

        Raises:
            RefusedError: the service refuses it.
        """


class Connector(Protocol[SpecT, ReportT_co]):
    """Opens connections to a service."""

    def connect(self) -> AbstractAsyncContextManager[ServiceClient[SpecT, ReportT_co]]:
        """Returns a connection that closes with the block. Raises LinkLostError if it cannot be opened."""


class ServiceLink(Generic[SpecT, ReportT, ViewT]):
    """Link to one service, which runs on when the gateway ends.

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
        self._name = name
        self._connector = connector
        self._reconciler = reconciler
        self._silence_s = silence_s
        self._apply_deadline_s = apply_deadline_s
        self._backoff = Backoff(FIRST_PAUSE_S, LONGEST_PAUSE_S)
        self.changes = Broadcast()

    @property
    def view(self) -> ViewT:
        """What clients may know of the service, from memory."""
        return self._reconciler.view

    @property
    def desired(self) -> Desired[SpecT]:
        """Newest desired state."""
        return self._reconciler.desired

    @property
    def failures(self) -> int:
        """Failures in a row to connect; 0 while the service is reachable."""
        return self._backoff.failures

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

    async def run(self) -> NoReturn:
        """Connects, and reconnects whenever the connection breaks, until cancelled."""
        while True:
            reason, detail = await self._session()
            pause_s = self._backoff.next_s()
            if self._reconciler.take_loss(reason):
                _log.warning("%s lost: %s", self._name, detail)
            elif self._backoff.failures == 1:
                _log.warning("%s not reached: %s", self._name, detail)
            self.changes.notify_all()
            await self._pause(pause_s)

    async def _pause(self, pause_s: float) -> None:
        """Waits; a new request cuts it short."""
        revision = self.desired.revision
        await self.changes.wait_until(lambda: self.desired.revision != revision, pause_s)

    async def _session(self) -> tuple[str, str]:
        """Serves one connection until it breaks; returns the reason and the detail."""
        try:
            async with self._connector.connect() as client:
                lost = await _first_loss(self._listen(client), self._keep_applied(client))
        except LinkLostError as error:
            lost = error
        # The exception itself would keep its frames, in them the call, and so the connection.
        return lost.reason, lost.detail

    async def _listen(self, client: ServiceClient[SpecT, ReportT]) -> None:
        reports = client.reports()
        while True:
            try:
                report = await _within(self._silence_s, anext(reports))
            except StopAsyncIteration:
                raise LinkLostError("it has closed its stream of reports") from None
            if report is None:
                raise LinkLostError(f"no report for {self._silence_s:g} s")
            self._take_report(report)

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
            report = await _within(self._apply_deadline_s, client.apply(desired))
        except RefusedError as error:
            _log.error("%s refuses revision %d: %s", self._name, desired.revision, error)
            self._reconciler.take_refusal(desired, str(error))
            self.changes.notify_all()
            return
        if report is None:
            raise LinkLostError(f"no answer to a request for {self._apply_deadline_s:g} s")
        self._take_report(report)

    def _take_report(self, report: ReportT) -> None:
        if self._reconciler.take_report(report, time.monotonic()):
            who, failures = report.instance_id, self._backoff.failures
            _log.info("%s connected (process %s), after %d failures", self._name, who, failures)
            self._backoff.reset()
        self.changes.notify_all()


async def _within(timeout_s: float, step: Awaitable[ResultT]) -> ResultT | None:
    """Returns None on a timeout, whose exception would form a cycle of task, frames and call."""
    try:
        async with asyncio.timeout(timeout_s):
            return await step
    except TimeoutError:
        return None


async def _first_loss(*jobs: Coroutine[Any, Any, None]) -> LinkLostError:
    """Runs endless jobs side by side until one loses the connection; returns its error.

    No TaskGroup: in Python 3.11.2, Debian 12's, it leaves the task that ran it marked as cancelled, and the
    next timeout in that task then cancels it. Raised from here, the error would form a cycle with this frame.
    """
    tasks = [asyncio.create_task(job) for job in jobs]
    try:
        ended, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        error = ended.pop().exception()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    if isinstance(error, LinkLostError):
        return error
    raise error or AssertionError("an endless job returned")
