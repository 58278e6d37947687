"""Files are read one block ahead: in order, their end withheld where they are damaged, closed in any case."""

import asyncio
import hashlib
import os
from collections.abc import AsyncGenerator
from contextlib import aclosing
from pathlib import Path

import google_crc32c
import psutil
import pytest

from common.open_file import CHUNK_BYTES, Chunk, UnreadableError
from common.pace import Pace
from common.paced_chunks import paced_chunks
from common.reader_threads import ClosedError
from recorder.store.export import Content, export
from recorder.store.readers import reader_threads
from recorder.store.sums import Sums, state_of
from tests.support.eventually import eventually

_DATA = os.urandom(10 * CHUNK_BYTES + 7)


def content(path: Path, data: bytes = _DATA) -> Content:
    path.write_bytes(data)
    return Content(path, len(_DATA), hashlib.sha256(_DATA).digest())


async def exported(file: Content, offset: int = 0, *paces: Pace) -> AsyncGenerator[Chunk]:
    with reader_threads() as readers:
        async with (
            export(file, readers, Sums(readers.files)) as opened,
            aclosing(paced_chunks(opened.file, offset, paces, opened.verified)) as found,
        ):
            async for each in found:
                yield each


async def read(file: Content, offset: int = 0) -> list[Chunk]:
    return [each async for each in exported(file, offset, Pace(0))]


@pytest.mark.parametrize("offset", [0, 1, CHUNK_BYTES, 5 * CHUNK_BYTES, len(_DATA) - 1, len(_DATA)])
async def test_chunks_are_in_order_from_any_offset(tmp_path: Path, offset: int) -> None:
    found = await read(content(tmp_path / "file"), offset)
    assert b"".join(each.data for each in found) == _DATA[offset:]
    assert [each.offset for each in found] == list(range(offset, len(_DATA), CHUNK_BYTES))
    assert all(each.crc32c == google_crc32c.value(each.data) for each in found)


async def test_the_end_of_a_damaged_file_is_withheld(tmp_path: Path) -> None:
    damaged = bytes([_DATA[0] ^ 1]) + _DATA[1:]
    stream = exported(content(tmp_path / "file", damaged))
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
    async with aclosing(exported(file)) as stream:
        for _ in range(taken):
            await anext(stream)

    async def open_files() -> int:
        return sum(each.path == str(file.path) for each in psutil.Process().open_files())

    await eventually(open_files, lambda count: count == 0, "the file is closed")
    assert failures == []


@pytest.mark.parametrize("offset", [0, 8 * CHUNK_BYTES])
async def test_the_first_byte_waits_for_no_sum_and_the_end_does(tmp_path: Path, offset: int) -> None:
    file = content(tmp_path / "file")
    slow = len(_DATA)  # a sum takes a second
    with reader_threads() as readers:
        sums = Sums(readers.files, max_bytes_per_s=slow)
        async with (
            export(file, readers, sums) as opened,
            aclosing(paced_chunks(opened.file, offset, (), opened.verified)) as found,
        ):
            first = await anext(found)
            assert first.offset == offset
            assert (sums.known(state_of(file.path)) is None) is (offset == 0), "the last block has waited"
            rest = [each async for each in found]
            assert sums.known(state_of(file.path)) == file.sha256
    assert first.data + b"".join(each.data for each in rest) == _DATA[offset:]


async def test_a_closed_file_ends_its_export(tmp_path: Path) -> None:
    file = content(tmp_path / "file")
    with reader_threads() as readers:
        async with (
            export(file, readers, Sums(readers.files)) as opened,
            aclosing(paced_chunks(opened.file, 0, (), opened.verified)) as found,
        ):
            await anext(found)
            opened.close()
            with pytest.raises(ClosedError):
                async for _ in found:
                    pass
            with pytest.raises(ClosedError):
                await opened.verified()
