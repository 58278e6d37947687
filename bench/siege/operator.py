"""The operator at work: how many calls were answered, and how fast."""

import asyncio
import random
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from typing import Any, Final, NoReturn

from console.client import AsyncGatewayClient, Credentials, GatewayError, Outage
from tests.support.detour import detour

STATUS_EVERY_S: Final = 0.1
PREVIEW_EVERY_S: Final = 2.0
LOGIN_EVERY_S: Final = 5.0
"""From the operator's address, and as often from one of which the gateway has never heard."""
UNKNOWN_LOGIN_WITHIN_S: Final = 60.0
"""Then it is given up."""
_REPEATED_AFTER_S: Final = 0.1
_PER_NETWORK: Final = 254


@dataclass
class Record:
    """What an operator saw for a while.

    Attributes:
        status_ms: how long each GetSystemStatus took; one that failed, until it did.
        login_ms: the same of a new connection and its first call.
        unknown_login_ms: the same from an address that the gateway has never heard of, until a call was
            answered, repetitions included; at most UNKNOWN_LOGIN_WITHIN_S.
        asked: calls, and statuses of the stream; without those from unknown addresses.
        failures: those without an answer, as errors for people.
    """

    status_ms: list[float] = field(default_factory=list)
    login_ms: list[float] = field(default_factory=list)
    unknown_login_ms: list[float] = field(default_factory=list)
    asked: int = 0
    failures: list[str] = field(default_factory=list)


class Operator:
    """One person with a console.

    Args:
        target: the gateway's address.
        credentials: an operator's.
    """

    def __init__(self, target: str, credentials: Credentials) -> None:
        self._target, self._credentials = target, credentials
        self._record = Record()
        # Of a gateway that goes on running, others than in a siege before.
        numbers = random.sample(range(256 * _PER_NETWORK), 256 * _PER_NETWORK)
        self._unknown = (f"127.5.{each // _PER_NETWORK}.{1 + each % _PER_NETWORK}" for each in numbers)

    def begin_record(self) -> Record:
        """Returns a record that is kept from now on. Calls count in that of their beginning."""
        self._record = Record()
        return self._record

    @asynccontextmanager
    async def working(self) -> AsyncIterator[None]:
        """Works while the block lasts. Calls begin at fixed times, whether or not the last one has ended."""
        async with self._new_client() as caller, self._new_client() as watcher, asyncio.TaskGroup() as tasks:
            work = [
                tasks.create_task(_every(STATUS_EVERY_S, lambda: self._status(caller), tasks)),
                tasks.create_task(_every(PREVIEW_EVERY_S, lambda: self._switch(caller), tasks)),
                tasks.create_task(_every(LOGIN_EVERY_S, self._log_in, tasks)),
                tasks.create_task(_every(LOGIN_EVERY_S, self._log_in_from_elsewhere, tasks)),
                tasks.create_task(self._watch(watcher)),
            ]
            try:
                yield
            finally:
                for each in work:
                    each.cancel()

    def _new_client(self) -> AsyncGatewayClient:
        return AsyncGatewayClient(self._target, credentials=self._credentials)

    async def _status(self, client: AsyncGatewayClient) -> None:
        took = self._record.status_ms
        took.append(await self._took_ms(client.status()))

    async def _switch(self, client: AsyncGatewayClient) -> None:
        # Off is what it is: what costs time here is the call, not the video.
        await self._took_ms(client.disable_preview(settle_within_s=0))

    async def _log_in(self) -> None:
        took = self._record.login_ms
        async with self._new_client() as client:
            took.append(await self._took_ms(client.status()))

    async def _log_in_from_elsewhere(self) -> None:
        took, began_s = self._record.unknown_login_ms, time.perf_counter()
        host, _, port = self._target.rpartition(":")
        async with (
            detour(next(self._unknown), int(port), host) as way,
            AsyncGatewayClient(f"{host}:{way}", credentials=self._credentials) as client,
        ):
            with suppress(TimeoutError):
                async with asyncio.timeout(UNKNOWN_LOGIN_WITHIN_S):
                    await _until_answered(client)
        took.append((time.perf_counter() - began_s) * 1000)

    async def _watch(self, client: AsyncGatewayClient) -> None:
        async for status in client.watch_status():
            self._record.asked += 1
            if isinstance(status, Outage):
                self._record.failures.append(f"stream: {status.error}")

    async def _took_ms(self, call: Awaitable[Any]) -> float:
        record, sent_s = self._record, time.perf_counter()
        record.asked += 1
        try:
            await call
        except GatewayError as error:
            record.failures.append(f"{type(error).__name__}: {error}")
        return (time.perf_counter() - sent_s) * 1000


async def _until_answered(client: AsyncGatewayClient) -> None:
    """Calls as a person does that types again."""
    while True:
        try:
            await client.status()
        except GatewayError:
            await asyncio.sleep(_REPEATED_AFTER_S)
        else:
            return


async def _every(period_s: float, work: Callable[[], Any], tasks: asyncio.TaskGroup) -> NoReturn:
    due_s = time.monotonic()
    while True:
        tasks.create_task(work())
        due_s += period_s
        await asyncio.sleep(due_s - time.monotonic())
