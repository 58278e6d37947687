"""Background callers beside the measured one, ten times a second each, in a process of their own.

    python -m bench.watch_load PORT WATCHERS CONSTANTS [stall] [flood]

Each watcher has a connection of its own and watches the status; a constant does the same with the reference's
stream of constant bytes. "stall" opens a watch and never reads; "flood" keeps many calls open on one
connection. Prints "ready" when every stream has begun; then, for each line on standard input, the number of
answers of each stream, as JSON. Ends when standard input closes.
"""

import asyncio
import json
import sys
from typing import Any

import grpc
import uvloop

from bench.calling import OWN_CONNECTION
from bench.status_server import CONSTANT_METHOD
from omniseer.gateway.v1.robot_gateway_pb2 import WatchSystemStatusRequest

SERVICE = "/omniseer.gateway.v1.RobotGateway"
INTERVAL_MS = 100
_FLOOD_CALLS = 200
"""Open at once, by one connection."""


class Load:
    """Streams and calls that continue until `end`."""

    def __init__(self, port: int) -> None:
        self._port = port
        self.received: list[int] = []
        self._began: list[asyncio.Event] = []
        self._tasks: list[asyncio.Task[None]] = []

    def streams(self, method: str, request: bytes, count: int) -> None:
        """Opens `count` connections with one stream each."""
        for _ in range(count):
            self.received.append(0)
            self._began.append(asyncio.Event())
            self._begin(self._read(len(self.received) - 1, method, request))

    async def all_began(self) -> None:
        """Waits until every stream has had an answer."""
        await asyncio.gather(*(each.wait() for each in self._began))

    def stall(self) -> None:
        """Opens a watch that never reads."""
        self._begin(self._never_read())

    def flood(self) -> None:
        """Keeps _FLOOD_CALLS calls open on one connection."""
        channel = self._channel()
        for _ in range(_FLOOD_CALLS):
            self._begin(self._ask_again_and_again(channel))

    def end(self) -> None:
        """Cancels everything."""
        for task in self._tasks:
            task.cancel()

    def _begin(self, work: Any) -> None:
        self._tasks.append(asyncio.create_task(work))

    def _channel(self) -> Any:
        return grpc.aio.insecure_channel(f"127.0.0.1:{self._port}", options=OWN_CONNECTION)

    async def _read(self, number: int, method: str, request: bytes) -> None:
        async with self._channel() as channel:
            async for _ in channel.unary_stream(method)(request):
                self.received[number] += 1
                self._began[number].set()

    async def _never_read(self) -> None:
        async with self._channel() as channel:
            call = channel.unary_stream(f"{SERVICE}/WatchSystemStatus")(b"")
            await call.wait_for_connection()
            await asyncio.Event().wait()

    async def _ask_again_and_again(self, channel: Any) -> None:
        call = channel.unary_unary(f"{SERVICE}/GetSystemStatus")
        while True:
            try:
                await call(b"")
            except grpc.aio.AioRpcError:
                continue


async def main(port: int, watchers: int, constants: int, others: list[str]) -> None:
    load = Load(port)
    request = WatchSystemStatusRequest(min_interval_ms=INTERVAL_MS).SerializeToString()
    load.streams(f"{SERVICE}/WatchSystemStatus", request, watchers)
    if constants:
        load.streams(CONSTANT_METHOD, bytes(await _answer_bytes(port, request)), constants)
    await load.all_began()
    if "stall" in others:
        load.stall()
    if "flood" in others:
        load.flood()
    print("ready", flush=True)
    while await asyncio.to_thread(sys.stdin.readline):
        print(json.dumps(load.received), flush=True)
    load.end()


async def _answer_bytes(port: int, request: bytes) -> int:
    """Returns the size of a watcher's answer."""
    async with grpc.aio.insecure_channel(f"127.0.0.1:{port}", options=OWN_CONNECTION) as channel:
        watch: Any = channel.unary_stream(f"{SERVICE}/WatchSystemStatus")
        return len(await watch(request).read())


if __name__ == "__main__":
    uvloop.run(main(int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), sys.argv[4:]))
