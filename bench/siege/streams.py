"""A caller with many status streams, in a process of its own: `python -m bench.siege.streams TARGET COUNT`.

Reads the caller's login from standard input. Prints "ready" when every stream has had a status and, when all
have been refused, the moment of the last refusal, by CLOCK_MONOTONIC.
"""

import asyncio
import sys
import time

import uvloop

from common.reasons import Reason
from console.client import AsyncGatewayClient, Credentials, GatewayError, Outage
from console.robots.login import parse_login

_INTERVAL_S = 1.0


async def main(target: str, count: int, credentials: Credentials) -> None:
    begun = [asyncio.Event() for _ in range(count)]
    async with asyncio.TaskGroup() as streams:
        for each in begun:
            streams.create_task(_watch(target, credentials, each))
        for each in begun:
            await each.wait()
        print("ready", flush=True)
    print(time.monotonic(), flush=True)


async def _watch(target: str, credentials: Credentials, begun: asyncio.Event) -> None:
    """Returns when the credential is revoked."""
    async with AsyncGatewayClient(target, credentials=credentials) as client:
        try:
            async for status in client.watch_status(_INTERVAL_S):
                if not isinstance(status, Outage):
                    begun.set()
        except GatewayError as error:
            if error.reason != Reason.CREDENTIAL_REVOKED:
                raise


if __name__ == "__main__":
    login = parse_login(sys.stdin.read())
    uvloop.run(main(sys.argv[1], int(sys.argv[2]), login.credentials))
