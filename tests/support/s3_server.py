"""A real S3 over HTTP, moto's server in a process of its own, and a proxy before it that fails at will.

What moto does not do, the proxy does in its place: moto accepts any signature, URLs for ever, a wrong
checksum and any amount of data. So an expired URL, a full store and damaged bytes are the proxy's.
"""

import asyncio
import socket
import subprocess
import sys
from collections import Counter, deque
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import aiohttp
import boto3
from aiohttp import web

from hub.receiver.config import StoreSettings
from tests.support.free import free_tcp_port
from tests.support.waiting import wait_until

_UP_WITHIN_S: Final = 60.0
_READ: Final = 64 * 1024
_KEPT: Final = ("ETag", "Content-Range")


@dataclass
class S3Server:
    """A store that runs; each test has a bucket of its own."""

    port: int
    directory: Path
    buckets: int = 0

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def client(self) -> Any:
        """The library's own client, with all rights."""
        return boto3.client(
            "s3",
            endpoint_url=self.url,
            region_name="us-east-1",
            aws_access_key_id="test",
            aws_secret_access_key="test",
        )

    def settings(self, **more: Any) -> StoreSettings:
        """How a receiver reaches a new bucket."""
        self.buckets += 1
        bucket = f"bucket-{self.buckets}"
        self.client.create_bucket(Bucket=bucket)
        secret = self.directory / "secret"
        secret.write_text("test\n", encoding="ascii")
        return StoreSettings(
            endpoint=self.url, bucket=bucket, access_key="test", secret_key_file=secret, **more
        )


@contextmanager
def s3_server(directory: Path, host: str = "127.0.0.1") -> Iterator[S3Server]:
    """Serves when the block begins, gone when it ends; containers reach it only at 0.0.0.0."""
    server = S3Server(free_tcp_port(), directory)
    command = [sys.executable, "-m", "tests.support.moto_server", "-H", host, "-p", str(server.port)]
    with (directory / "s3.log").open("wb") as log:
        process = subprocess.Popen(command, stdout=log, stderr=log)

    def serves() -> bool:
        assert process.poll() is None, (directory / "s3.log").read_text(encoding="utf-8")[-2000:]
        try:
            with socket.create_connection(("127.0.0.1", server.port), timeout=5):
                return True
        except OSError:
            return False

    try:
        wait_until(serves, "the store serves", _UP_WITHIN_S)
        yield server
    finally:
        process.kill()
        process.wait()


@dataclass
class FaultyStore:
    """The way to a store, as robots see it: passes requests on, unless it is to fail.

    Attributes:
        port: where it listens.
        received: bytes of parts that have arrived here, by part number, those of cut requests included.
        passed: parts that the store has taken, in order.
        cut_at: closes the connection once so many bytes of parts have arrived in all, once.
        hold_at: number of a part, and after how many bytes of it no more is read, once; the store never gets
            that request, and it is never answered.
        held: set once a request is held.
        answers: status and code of the next requests, in place of the store's; None passes one on.
        early: whether these come before the body is read.
        refused: part of the paths of which no request is passed on; they get 400.
    damage: the number of the part that is changed on its way, once.
    cut_reading_at: closes the connection after so many bytes of an object that is read, once.
    ranges: of the requests that read objects, in order; empty for the whole.
    """

    port: int
    received: Counter[int] = field(default_factory=Counter)
    passed: list[int] = field(default_factory=list)
    cut_at: int | None = None
    hold_at: tuple[int, int] | None = None
    held: asyncio.Event = field(default_factory=asyncio.Event)
    answers: deque[tuple[int, str] | None] = field(default_factory=deque)
    early: bool = False
    refused: str = ""
    damage: int = 0
    cut_reading_at: int | None = None
    ranges: list[str] = field(default_factory=list)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def host(self) -> str:
        return f"127.0.0.1:{self.port}"

    @property
    def total(self) -> int:
        """Bytes of parts that have arrived in all."""
        return sum(self.received.values())


@asynccontextmanager
async def faulty_store(server: S3Server) -> AsyncIterator[FaultyStore]:
    """Listens until the block ends."""
    state, over = FaultyStore(free_tcp_port()), asyncio.Event()
    async with aiohttp.ClientSession(auto_decompress=False) as session:

        async def handle(request: web.Request) -> web.StreamResponse:
            number = int(request.query.get("partNumber", "0"))
            answer = state.answers.popleft() if state.answers else None
            if state.refused and state.refused in request.path:
                answer = (400, "InvalidRequest")
            if answer and state.early:
                return _error(*answer)
            body = bytearray()
            with suppress(ConnectionError):  # The robot has gone: what it gets does not matter.
                while data := await request.content.read(_READ):
                    body += data
                    state.received[number] += len(data)
                    if state.cut_at is not None and state.total >= state.cut_at and request.transport:
                        state.cut_at = None
                        request.transport.abort()
                    if state.hold_at and number == state.hold_at[0] and len(body) >= state.hold_at[1]:
                        state.hold_at = None
                        state.held.set()
                        await over.wait()
                        return web.Response(status=503)
            if len(body) < (request.content_length or 0):
                return web.Response(status=400)
            if answer:
                return _error(*answer)
            if number and state.damage == number:
                state.damage = 0
                body[0] ^= 1
            sent = {"Range": request.headers["Range"]} if "Range" in request.headers else {}
            async with session.request(
                request.method, f"{server.url}{request.raw_path}", data=bytes(body), headers=sent
            ) as passed:
                if request.method == "GET":
                    state.ranges.append(sent.get("Range", ""))
                elif passed.status == 200:
                    state.passed.append(number)
                kept = {name: passed.headers[name] for name in _KEPT if name in passed.headers}
                content = await passed.read()
            if request.method != "GET" or state.cut_reading_at is None:
                return web.Response(status=passed.status, body=content, headers=kept)
            cut_at, state.cut_reading_at = state.cut_reading_at, None
            answer_stream = web.StreamResponse(status=passed.status, headers=kept)
            answer_stream.content_length = len(content)
            await answer_stream.prepare(request)
            await answer_stream.write(content[:cut_at])
            if request.transport:
                request.transport.close()
            return answer_stream

        application = web.Application(client_max_size=0)
        application.router.add_route("*", "/{path:.*}", handle)
        runner = web.AppRunner(application, handle_signals=False, shutdown_timeout=0.1)
        await runner.setup()
        try:
            await web.TCPSite(runner, "127.0.0.1", state.port).start()
            yield state
        finally:
            over.set()
            await runner.cleanup()


def _error(status: int, code: str) -> web.Response:
    return web.Response(status=status, text=f"<Error><Code>{code}</Code></Error>")
