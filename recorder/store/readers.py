"""Threads that read the disk for callers: what records and makes room has others, and never waits."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from common.reader_threads import ReaderThreads


@dataclass(frozen=True, slots=True)
class Readers:
    """Threads by what they read, so that no number of lists and pictures keeps an export waiting.

    Attributes:
        files: exports, and sums of files: a block each.
        looks: lists of run bundles, and pictures.
    """

    files: ReaderThreads
    looks: ReaderThreads


@contextmanager
def reader_threads() -> Iterator[Readers]:
    """Yields the threads, which end with the block."""
    readers = Readers(
        ReaderThreads("files", threads=3, most=64), ReaderThreads("its recordings", threads=2, most=16)
    )
    try:
        yield readers
    finally:
        readers.files.close()
        readers.looks.close()
