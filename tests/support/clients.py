"""Both clients with one face, so that one suite holds both to the same."""

import asyncio
import inspect
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import Any, Self

from console.client import AsyncGatewayClient, ClientOptions, GatewayClient
from tests.support.eventually import eventually
from tests.support.waiting import wait_until


class Blocking:
    """The blocking client, and what takes a second thread to do with it."""

    def __init__(self, target: str, options: ClientOptions | None = None) -> None:
        self._client = GatewayClient(target, options)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._client.close()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._client, name)

    def many_at_once(self, count: int) -> list[Any]:
        """As many looks at the status, all under way together."""
        with ThreadPoolExecutor(count) as threads:
            barrier = threading.Barrier(count)

            def look(_: int) -> Any:
                barrier.wait(10)
                return self._client.status()

            return list(threads.map(look, range(count)))

    def closed_while(self, is_asking: Callable[[], object]) -> Any:
        """A look at the status, under which the client is closed once `is_asking`."""
        with ThreadPoolExecutor(1) as threads:
            look = threads.submit(self._client.status)
            wait_until(is_asking, "the call is under way")
            self._client.close()
            return look.result(10)


class Asyncio:
    """The asyncio client in a loop of its own, which runs while a call does."""

    def __init__(self, target: str, options: ClientOptions | None = None) -> None:
        self._runner = asyncio.Runner()

        async def made() -> AsyncGatewayClient:
            return AsyncGatewayClient(target, options)

        self._client = self._runner.run(made())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._runner.run(self._client.close())
        self._runner.close()

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._client, name)
        if not inspect.iscoroutinefunction(found):
            return found
        return lambda *arguments, **named: self._runner.run(found(*arguments, **named))

    def many_at_once(self, count: int) -> list[Any]:
        """As `Blocking.many_at_once`."""

        async def looks() -> list[Any]:
            return list(await asyncio.gather(*(self._client.status() for _ in range(count))))

        return self._runner.run(looks())

    def closed_while(self, is_asking: Callable[[], object]) -> Any:
        """As `Blocking.closed_while`."""

        async def look() -> Any:
            asking = asyncio.create_task(self._client.status())

            async def ask() -> object:
                return is_asking()

            await eventually(ask, bool, "the call is under way")
            await self._client.close()
            return await asking

        return self._runner.run(look())


Face = Blocking | Asyncio
FACES: tuple[type[Face], ...] = (Blocking, Asyncio)
