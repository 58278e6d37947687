"""Files are read one block ahead: in order, their end withheld where they are damaged, closed in any case."""

import asyncio
import hashlib
import os
from contextlib import aclosing
from pathlib import Path

import google_crc32c
import psutil
import pytest

from common.pace import Pace
from recorder.store.export import CHUNK_BYTES, Chunk, Content, UnreadableError, chunks
from tests.support.eventually import eventually

_DATA = os.urandom(10 * CHUNK_BYTES + 7)


def content(path: Path, data: bytes = _DATA) -> Content:
    path.write_bytes(data)
    return Content(path, len(_DATA), hashlib.sha256(_DATA).digest())


async def read(file: Content, offset: int = 0) -> list[Chunk]:
    return [each async for each in chunks(file, offset, (Pace(0),), lambda: None)]


@pytest.mark.parametrize("offset", [0, 1, CHUNK_BYTES, 5 * CHUNK_BYTES, len(_DATA) - 1, len(_DATA)])
async def test_chunks_are_in_order_from_any_offset(tmp_path: Path, offset: int) -> None:
    found = await read(content(tmp_path / "file"), offset)
    assert b"".join(each.data for each in found) == _DATA[offset:]
    assert [each.offset for each in found] == list(range(offset, len(_DATA), CHUNK_BYTES))
    assert all(each.crc32c == google_crc32c.value(each.data) for each in found)


async def test_the_end_of_a_damaged_file_is_withheld(tmp_path: Path) -> None:
    damaged = bytes([_DATA[0] ^ 1]) + _DATA[1:]
    stream = chunks(content(tmp_path / "file", damaged), 0, (), lambda: None)
    received = bytearray()

    async def receive() -> None:
        async for each in stream:
            received.extend(each.data)

    with pytest.raises(UnreadableError, match="SHA-256"):
        await receive()
    assert received == damaged[: len(received)]
    assert len(received) < len(_DATA)


async def test_another_size_and_a_missing_file_are_unreadable(tmp_path: Path) -> None:
    with pytest.raises(UnreadableError, match="size"):
        await read(content(tmp_path / "file", _DATA + b"x"))
    with pytest.raises(UnreadableError, match="No such file"):
        await read(Content(tmp_path / "missing", 1, bytes(32)))


@pytest.mark.parametrize("taken", [0, 1, 5])
async def test_a_caller_who_leaves_leaves_no_open_file(tmp_path: Path, taken: int) -> None:
    file = content(tmp_path / "file")
    failures: list[object] = []
    asyncio.get_running_loop().set_exception_handler(lambda _loop, context: failures.append(context))
    async with aclosing(chunks(file, 0, (), lambda: None)) as stream:
        for _ in range(taken):
            await anext(stream)

    async def open_files() -> int:
        return sum(each.path == str(file.path) for each in psutil.Process().open_files())

    await eventually(open_files, lambda count: count == 0, "the file is closed")
    assert failures == []
