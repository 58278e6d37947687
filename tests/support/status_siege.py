"""Watchers of a gateway and one caller that floods it, in a process of their own: `ADDRESS WATCHERS [LOGIN]`.

LOGIN is the file of a login, where the gateway asks for one. Prints "ready" when all watch; goes on until
it is ended.
"""

import asyncio
import sys
from collections.abc import AsyncGenerator
from pathlib import Path

from console.client import AsyncGatewayClient, Credentials, GatewayError
from console.robots.login import parse_login

_STREAMS = 10
"""Watchers on one connection."""
_AT_ONCE = 16
"""Calls of the flooder that are open at once."""


async def main(target: str, watchers: int, login: Credentials | None) -> None:
    """Begins, and goes on until the process ends."""
    clients = [AsyncGatewayClient(target, credentials=login) for _ in range(watchers // _STREAMS)]
    streams = [client.watch_status() for client in clients for _ in range(_STREAMS)]
    await asyncio.gather(*(anext(stream) for stream in streams))
    flooder = AsyncGatewayClient(target, credentials=login)
    jobs = [asyncio.create_task(watch(stream)) for stream in streams]
    jobs += [asyncio.create_task(flood(flooder)) for _ in range(_AT_ONCE)]
    print("ready", flush=True)
    await asyncio.gather(*jobs)


async def watch(stream: AsyncGenerator[object]) -> None:
    """Reads all that comes."""
    async for _ in stream:
        pass


async def flood(client: AsyncGatewayClient) -> None:
    """Calls again as soon as it is answered or refused."""
    while True:
        try:
            await client.status()
        except GatewayError:
            await asyncio.sleep(0)


def _login(file: str) -> Credentials:
    return parse_login(Path(file).read_text(encoding="utf-8")).credentials


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], int(sys.argv[2]), _login(sys.argv[3]) if sys.argv[3:] else None))
