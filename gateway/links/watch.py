"""Watches a service: connects, takes its reports, notices its silence, reconnects with backoff."""

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Coroutine
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from typing import Any, Final, Generic, NoReturn, Protocol, TypeVar

from common.backoff import Backoff
from common.broadcast import Broadcast
from common.tasks import cancel

_log = logging.getLogger(__name__)
ResultT = TypeVar("ResultT")

FIRST_PAUSE_S: Final = 0.1
LONGEST_PAUSE_S: Final = 1.0
ABSENT: Final = "nothing answers on its socket"
"""Why a service is lost that can't be reached, for people."""


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


class Identified(Protocol):
    """The part of a report that every service sends."""

    @property
    def instance_id(self) -> str:
        """Names the process of the service."""


ReportT = TypeVar("ReportT", bound=Identified)
ReportT_co = TypeVar("ReportT_co", bound=Identified, covariant=True)


class Reporter(Protocol[ReportT_co]):
    """One connection to a service."""

    def reports(self) -> AsyncIterator[ReportT_co]:
        """Yields the actual state now, on every change, and often enough as a sign of life.

        Raises:
            LinkLostError: the connection has broken.
        """


ClientT = TypeVar("ClientT", bound=Reporter[Any])
ClientT_co = TypeVar("ClientT_co", bound=Reporter[Any], covariant=True)


class WatchConnector(Protocol[ClientT_co]):
    """Opens connections to a service."""

    def connect(self) -> AbstractAsyncContextManager[ClientT_co]:
        """Returns a connection that closes with the block. Raises LinkLostError if it cannot be opened."""


class SharingConnector(Generic[ClientT]):
    """A connector for a link. A subclass uses the connection for calls of its own as well.

    Args:
        connector: opens the connections.
    """

    def __init__(self, connector: WatchConnector[ClientT]) -> None:
        self._connector = connector
        self._client: ClientT | None = None
        """None while there is no connection."""

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[ClientT]:
        """Yields a connection. Raises LinkLostError if it cannot be opened."""
        async with self._connector.connect() as client:
            self._client = client
            try:
                yield client
            finally:
                self._client = None


class ServiceWatch(Generic[ClientT, ReportT]):
    """The connection to one service, which runs on when the gateway ends. A subclass keeps what it reports.

    Args:
        name: of the service and where it listens, for the log.
        connector: opens the connections.
        silence_s: a service without a report for so long is gone.

    Attributes:
        changes: wakes on each report and loss.
    """

    def __init__(self, name: str, connector: WatchConnector[ClientT], *, silence_s: float = 2.5) -> None:
        self._name = name
        self._connector = connector
        self._silence_s = silence_s
        self._backoff = Backoff(FIRST_PAUSE_S, LONGEST_PAUSE_S)
        self.changes = Broadcast()

    @property
    def failures(self) -> int:
        """Failures in a row to connect; 0 while the service is reachable."""
        return self._backoff.failures

    async def run(self) -> NoReturn:
        """Connects, and reconnects whenever the connection breaks, until cancelled."""
        while True:
            reason, detail = await self._session()
            pause_s = self._backoff.next_s()
            if self._record_loss(reason):
                _log.warning("%s lost: %s", self._name, detail)
            elif self._backoff.failures == 1:
                _log.warning("%s not reached: %s", self._name, detail)
            self.changes.notify_all()
            await self._pause(pause_s)

    def _record(self, report: ReportT) -> bool:
        """Keeps a report; returns whether the service was unreachable before."""
        raise NotImplementedError

    def _record_loss(self, reason: str) -> bool:
        """Keeps a lost connection or a failed attempt; returns whether the service was reachable before."""
        raise NotImplementedError

    def _jobs(self, client: ClientT) -> list[Coroutine[Any, Any, None]]:
        """Returns what runs while a connection lasts, each without an end of its own."""
        return [self._listen(client)]

    async def _pause(self, pause_s: float) -> None:
        """Waits before the next attempt."""
        await asyncio.sleep(pause_s)

    def _take_report(self, report: ReportT) -> None:
        if self._record(report):
            who, failures = report.instance_id, self._backoff.failures
            _log.info("%s connected (process %s), after %d failures", self._name, who, failures)
            self._backoff.reset()
        self.changes.notify_all()

    async def _session(self) -> tuple[str, str]:
        """Serves one connection until it breaks; returns the reason and the detail."""
        try:
            async with self._connector.connect() as client:
                lost = await _first_loss(*self._jobs(client))
        except LinkLostError as error:
            lost = error
        # The exception itself would keep its frames, in them the call, and so the connection.
        return lost.reason, lost.detail

    async def _listen(self, client: ClientT) -> None:
        reports = client.reports()
        while True:
            try:
                report = await reply_within(self._silence_s, anext(reports))
            except StopAsyncIteration:
                raise LinkLostError("it has closed its stream of reports") from None
            if report is None:
                raise LinkLostError(f"no report for {self._silence_s:g} s")
            self._take_report(report)


async def reply_within(timeout_s: float, step: Awaitable[ResultT]) -> ResultT | None:
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
        await cancel(tasks)
    if isinstance(error, LinkLostError):
        return error
    raise error or AssertionError("an endless job returned")
