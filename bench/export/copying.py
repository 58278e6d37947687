"""A client that takes bytes and does nothing with them: `python -m bench.export.copying TARGET STREAMS`.

STREAMS is a list of methods and requests as JSON. The process makes these calls again and again until its
standard input closes; it prints "ready" when the first bytes have come. Ours and the reference have the
same client, so that what it needs is the same on both sides.
"""

import asyncio
import json
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

import grpc
import uvloop

from bench.calling import OWN_CONNECTION
from bench.processes import program
from omniseer.gateway.v1.recording_pb2 import DESCRIPTOR

METHOD: Final = f"/{DESCRIPTOR.services_by_name['RecordingService'].full_name}/ExportRecording"
_OPTIONS: Final = (*OWN_CONNECTION, ("grpc.max_receive_message_length", 4 * 1024 * 1024))
_MIB: Final = 1024 * 1024


@dataclass(frozen=True, slots=True)
class Stream:
    """A call whose responses are copied: its method, and the request, serialised."""

    method: str
    request: bytes


@dataclass(frozen=True, slots=True)
class Copied:
    """What came, with the bytes that frame it in the messages, and how long that took."""

    size: int
    seconds: float

    @property
    def mib_s(self) -> float:
        """MiB a second."""
        return self.size / _MIB / self.seconds


def copied(target: str, streams: Sequence[Stream]) -> Copied:
    """Makes the calls one after the other, over one connection."""
    return asyncio.run(_copied(target, streams))


async def _copied(target: str, streams: Sequence[Stream]) -> Copied:
    async with grpc.aio.insecure_channel(target, options=_OPTIONS) as channel:
        await channel.channel_ready()
        began_s = time.perf_counter()
        size = 0
        for each in streams:
            async for response in _call(channel, each):
                size += len(response)
        return Copied(size, time.perf_counter() - began_s)


@contextmanager
def copier(target: str, streams: Sequence[Stream]) -> Iterator[None]:
    """Makes the calls from a process of its own, over and over, while the block lasts."""
    words = [json.dumps([[each.method, each.request.hex()] for each in streams])]
    with program("bench.export.copying", target, *words):
        yield


def _call(channel: Any, stream: Stream) -> Any:
    return channel.unary_stream(stream.method)(stream.request)


async def _copy_on(target: str, streams: Sequence[Stream]) -> None:
    ends = asyncio.ensure_future(asyncio.to_thread(sys.stdin.read))
    async with grpc.aio.insecure_channel(target, options=_OPTIONS) as channel:
        announced = False
        while not ends.done():
            for each in streams:
                async for _ in _call(channel, each):
                    if not announced:
                        announced = True
                        print("ready", flush=True)
                    if ends.done():
                        return


if __name__ == "__main__":
    asked = [Stream(method, bytes.fromhex(request)) for method, request in json.loads(sys.argv[2])]
    uvloop.run(_copy_on(sys.argv[1], asked))
