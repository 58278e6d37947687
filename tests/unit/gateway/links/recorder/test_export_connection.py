"""The gateway's end of the connection that hands over an export's file."""

import asyncio
import errno
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from common.export_connection import KEY_BYTES, ORDER
from common.reader_threads import ReaderThreads
from gateway.links.recorder.export_connection import handed_file
from tests.support.descriptors import descriptors_of

KEY = bytes(KEY_BYTES)


@pytest.fixture
def threads() -> Iterator[ReaderThreads]:
    made = ReaderThreads("exports", threads=1, most=1)
    yield made
    made.close()


async def test_without_a_descriptor_for_the_connection_the_call_carries_the_chunks(
    tmp_path: Path, threads: ReaderThreads, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: Any) -> socket.socket:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr(socket, "socket", refused)
    async with handed_file(tmp_path / "exports", KEY, threads) as handed:
        assert handed is None


async def test_a_file_that_arrives_with_a_cancellation_is_closed(
    tmp_path: Path, threads: ReaderThreads, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: the descriptor was the result of a task for which no caller was left."""
    file, path = tmp_path / "file", tmp_path / "exports"
    file.write_bytes(b"content")
    loop, receive = asyncio.get_running_loop(), socket.recv_fds

    async def take() -> None:
        async with handed_file(path, KEY, threads):
            pytest.fail("it was cancelled before")

    def receive_and_cancel(*args: Any) -> Any:
        received = receive(*args)
        taking.cancel()
        return received

    monkeypatch.setattr(socket, "recv_fds", receive_and_cancel)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK) as listener:
        listener.bind(str(path))
        listener.listen()
        taking = asyncio.create_task(take())
        connected, _ = await loop.sock_accept(listener)
        with connected, file.open("rb") as opened:
            assert await loop.sock_recv(connected, KEY_BYTES) == KEY
            socket.send_fds(connected, [ORDER.pack(0, 7, 0)], [opened.fileno()])
            with pytest.raises(asyncio.CancelledError):
                await taking
    assert descriptors_of(file) == []
