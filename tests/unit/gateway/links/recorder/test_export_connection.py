"""The gateway's end of the connection that hands over an export's file."""

import errno
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from common.export_connection import KEY_BYTES
from common.reader_threads import ReaderThreads
from gateway.links.recorder.export_connection import handed_file

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
