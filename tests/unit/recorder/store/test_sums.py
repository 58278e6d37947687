"""A sum is computed once, for all who ask, and goes on where it was left."""

import asyncio
import hashlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from common.open_file import UnreadableError
from recorder.store import sums as module
from recorder.store.readers import Readers, reader_threads
from recorder.store.sums import Sums, state_of
from tests.support.eventually import eventually

MIB = 1024 * 1024
DATA = os.urandom(3 * MIB + 5)
SHA256 = hashlib.sha256(DATA).digest()


@pytest.fixture
def readers() -> Iterator[Readers]:
    with reader_threads() as made:
        yield made


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Bytes of each read."""
    sizes: list[int] = []
    take = module._take

    def counted(descriptor: int, size: int, begun: Any) -> None:
        sizes.append(size)
        take(descriptor, size, begun)

    monkeypatch.setattr(module, "_take", counted)
    return sizes


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "file"
    path.write_bytes(DATA)
    return path


def rewrite(file: Path, changed_ns: int) -> None:
    file.write_bytes(b"x" * len(DATA))
    os.utime(file, ns=(0, changed_ns))


async def test_many_who_ask_at_once_and_later_have_it_read_once(
    readers: Readers, read: list[int], file: Path
) -> None:
    sums, state = Sums(readers.files), state_of(file)
    assert sums.known(state) is None
    assert set(await asyncio.gather(*(sums.sha256(state) for _ in range(8)))) == {SHA256}
    assert await sums.sha256(state) == SHA256
    assert sums.known(state) == SHA256
    assert sum(read) == len(DATA)


async def test_who_leaves_costs_the_next_one_nothing(readers: Readers, read: list[int], file: Path) -> None:
    sums, state = Sums(readers.files, max_bytes_per_s=4 * MIB), state_of(file)

    async def count() -> int:
        return len(read)

    for _ in range(3):
        asking = asyncio.create_task(sums.sha256(state))
        seen = len(read)
        await eventually(count, lambda now, seen=seen: now > seen, "it is being read")  # type: ignore[misc]
        asking.cancel()
        await asyncio.wait({asking})
    assert await sums.sha256(state) == SHA256
    assert sum(read) == len(DATA)


async def test_another_content_is_another_file(readers: Readers, file: Path) -> None:
    sums, before = Sums(readers.files), state_of(file)
    await sums.sha256(before)
    rewrite(file, before.changed_ns + 1)
    after = state_of(file)
    assert await sums.sha256(after) == hashlib.sha256(b"x" * len(DATA)).digest()
    sums = Sums(readers.files)
    with pytest.raises(UnreadableError, match="changed"):
        await sums.sha256(before)


async def test_links_directories_and_missing_files_are_not_read(readers: Readers, file: Path) -> None:
    sums, state = Sums(readers.files), state_of(file)
    link = file.with_name("link")
    link.symlink_to(file)
    for path in (link, file.parent, file.with_name("missing")):
        with pytest.raises(UnreadableError):
            state_of(path)
    os.replace(link, file)  # noqa: PTH105  # a link in its place
    with pytest.raises(UnreadableError):
        await sums.sha256(state)


async def test_the_pace_holds_for_all_files_together(readers: Readers, tmp_path: Path) -> None:
    sums, states = Sums(readers.files, max_bytes_per_s=4 * MIB), []
    for number in range(2):
        (tmp_path / str(number)).write_bytes(bytes(2 * MIB))
        states.append(state_of(tmp_path / str(number)))
    began_s = asyncio.get_running_loop().time()
    await asyncio.gather(*(sums.sha256(each) for each in states))
    assert asyncio.get_running_loop().time() - began_s >= 0.7, "4 MiB at 4 MiB/s, but for the first block"


async def test_what_is_kept_is_bounded(
    readers: Readers, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MAX_KNOWN", 2)
    sums, states = Sums(readers.files), []
    for number in range(3):
        (tmp_path / str(number)).write_bytes(b"content")
        states.append(state_of(tmp_path / str(number)))
        await sums.sha256(states[-1])
    assert [sums.known(each) is not None for each in states] == [False, True, True]
