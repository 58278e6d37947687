"""A caller with many status streams, in a process of its own: `python -m bench.siege.streams TARGET COUNT`.

Reads the caller's login from standard input. Prints "ready" when every stream has had a status and, when all
have been refused, the moment of the last refusal, by CLOCK_MONOTONIC.
"""

import asyncio
import sys
import time
from collections.abc import Callable

import uvloop

from common.reasons import Reason
from console.client import AsyncGatewayClient, Credentials, GatewayError, Outage
from console.robots.login import parse_login

_INTERVAL_S = 1.0
_PER_CONNECTION = 4
"""Streams; one caller may have a few connections only (`limits.connections_per_caller`)."""
_AT_A_TIME = 8
"""Connections, while they connect: the gateway closes connections that are many and have made no call yet."""


async def main(target: str, count: int, credentials: Credentials) -> None:
    connecting = asyncio.Semaphore(_AT_A_TIME)
    async with asyncio.TaskGroup() as streams:
        for first in range(0, count, _PER_CONNECTION):
            await connecting.acquire()
            together = min(_PER_CONNECTION, count - first)
            streams.create_task(_watch_together(target, credentials, together, connecting.release))
        for _ in range(_AT_A_TIME):
            await connecting.acquire()
        print("ready", flush=True)
    print(time.monotonic(), flush=True)


async def _watch_together(
    target: str, credentials: Credentials, count: int, begun: Callable[[], None]
) -> None:
    """Watches by one connection until the credential is revoked; calls `begun` when all have begun."""
    waiting = count

    def one_has_begun() -> None:
        nonlocal waiting
        waiting -= 1
        if not waiting:
            begun()

    async with (
        AsyncGatewayClient(target, credentials=credentials) as client,
        asyncio.TaskGroup() as streams,
    ):
        for _ in range(count):
            streams.create_task(_watch(client, one_has_begun))


async def _watch(client: AsyncGatewayClient, begun: Callable[[], None]) -> None:
    """Returns when the credential is revoked; calls `begun` once, at the first status."""
    waiting = True
    try:
        async for status in client.watch_status(_INTERVAL_S):
            if waiting and not isinstance(status, Outage):
                waiting = False
                begun()
    except GatewayError as error:
        if error.reason != Reason.CREDENTIAL_REVOKED:
            raise


if __name__ == "__main__":
    login = parse_login(sys.stdin.read())
    uvloop.run(main(sys.argv[1], int(sys.argv[2]), login.credentials))
