"""A store that stands still in the midst of a file, and others that are none."""

import asyncio
import ssl
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from common.ca import issue_server_certificate, new_ca
from console.client.errors import NotTrusted, Unreachable
from console.client.results import ExportChunk, ExportHeader, RecordingFile
from console.fleet.fetching import tls_context
from console.fleet.store import StoreStream

FILE = RecordingFile(name="a", size=1_000_000, sha256=b"s" * 32, final=True)


class OneUrl:
    """The same URL for each file."""

    def __init__(self, url: str) -> None:
        self._url = url

    async def url(self, _name: str) -> str:
        return self._url

    def forget(self, _name: str) -> None:
        raise AssertionError("it was good")


@asynccontextmanager
async def stalling(version: str, sent: int, *, closes: bool = False) -> AsyncIterator[str]:
    """A store that sends a part of the file and then nothing; its URL."""

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(f"{version} 200 OK\r\nContent-Length: {FILE.size}\r\n\r\n".encode() + bytes(sent))
        await writer.drain()
        if not closes:
            await reader.read()
        writer.close()

    server = await asyncio.start_server(answer, "127.0.0.1", 0)
    async with server:
        yield f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}/key"


async def took(stream: StoreStream, size: int) -> None:
    """Reads so many bytes."""
    assert await stream.read() == ExportHeader(size=FILE.size, sha256=FILE.sha256)
    done = 0
    while done < size:
        chunk = await stream.read()
        assert isinstance(chunk, ExportChunk)
        assert chunk.offset == done
        done += len(chunk.data)


# HTTP/1.0 closes the connection after an answer: the library treats the socket in another way.
@pytest.mark.parametrize("version", ["HTTP/1.1", "HTTP/1.0"])
async def test_a_reader_that_waits_is_ended_at_once(version: str) -> None:
    async with stalling(version, 5000) as url:
        stream = StoreStream(FILE, 0, OneUrl(url), tls_context(None))
        await took(stream, 5000)
        waiting = asyncio.create_task(stream.read())
        done, _ = await asyncio.wait({waiting}, timeout=0.2)
        assert not done
        begin_s = time.monotonic()
        stream.cancel()
        with pytest.raises(Unreachable):
            await waiting
        assert time.monotonic() - begin_s < 5
        stream.cancel()


@pytest.mark.parametrize("version", ["HTTP/1.1", "HTTP/1.0"])
async def test_silence_is_a_cut(version: str) -> None:
    async with stalling(version, 5000) as url:
        stream = StoreStream(FILE, 0, OneUrl(url), tls_context(None))
        assert await stream.read(0.3) == ExportHeader(size=FILE.size, sha256=FILE.sha256)
        assert isinstance(await stream.read(0.3), ExportChunk)
        with pytest.raises(Unreachable, match="timed out"):
            await stream.read(0.3)
        stream.cancel()


async def test_an_early_end_is_a_cut() -> None:
    async with stalling("HTTP/1.1", 5000, closes=True) as url:
        stream = StoreStream(FILE, 0, OneUrl(url), tls_context(None))
        await took(stream, 5000)
        with pytest.raises(Unreachable, match="too early"):
            await stream.read()
        stream.cancel()


async def test_a_store_that_does_not_speak_http_or_tls_is_not_reached() -> None:
    async def rude(_reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"220 smtp.example\r\n" * 3)
        writer.close()

    server = await asyncio.start_server(rude, "127.0.0.1", 0)
    async with server:
        port = server.sockets[0].getsockname()[1]
        for scheme in ("http", "https"):
            stream = StoreStream(FILE, 0, OneUrl(f"{scheme}://127.0.0.1:{port}/key"), tls_context(None))
            with pytest.raises(Unreachable):
                await stream.read()
            stream.cancel()


async def test_a_certificate_of_a_strange_authority_is_not_trusted(tmp_path: Path) -> None:
    home = tmp_path
    ours, other = new_ca("ours", 1), new_ca("other", 1)
    pair = issue_server_certificate(ours, "store", ["127.0.0.1"], 1)
    for name, content in (("cert", pair.certificate), ("key", pair.key), ("ours", ours.certificate)):
        (home / name).write_bytes(content)
    (home / "other").write_bytes(other.certificate)
    server_side = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    server_side.load_cert_chain(home / "cert", home / "key")

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(f"HTTP/1.1 200 OK\r\nContent-Length: {FILE.size}\r\n\r\n".encode() + bytes(10))
        await writer.drain()
        writer.close()

    server = await asyncio.start_server(answer, "127.0.0.1", 0, ssl=server_side)
    async with server:
        url = OneUrl(f"https://127.0.0.1:{server.sockets[0].getsockname()[1]}/key")
        for authority in (None, home / "other"):
            stream = StoreStream(FILE, 0, url, tls_context(authority))
            with pytest.raises(NotTrusted, match="not trusted") as caught:
                await stream.read()
            assert "--store-ca" in caught.value.remedy
            stream.cancel()
        stream = StoreStream(FILE, 0, url, tls_context(home / "ours"))
        assert isinstance(await stream.read(), ExportHeader)
        stream.cancel()
