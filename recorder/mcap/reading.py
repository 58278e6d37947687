"""Reading final segments: what one contains, and its messages of one topic."""

import hashlib
import struct
from collections.abc import Iterator
from io import BufferedReader
from pathlib import Path
from typing import Any, Final

import zstandard
from mcap.exceptions import McapError
from mcap.reader import SeekingReader

from recorder.mcap.records import OFFERED_QOS, UNNUMBERED, gap_of_note
from recorder.values import ChannelSummary, Note, SegmentSummary

_DAMAGES: Final = (
    *(McapError, struct.error, zstandard.ZstdError),
    *(ValueError, KeyError, IndexError, OverflowError, MemoryError),
)
"""The library checks lengths, but not everything that a damaged file can have in place of them."""


def summarise(path: Path) -> SegmentSummary | None:
    """Returns what a final segment contains, by its own index; None if it is damaged.

    Raises:
        OSError: the disk fails.
    """
    with path.open("rb") as file:
        try:
            return _summary(path, file)
        except _DAMAGES:
            return None


def messages(path: Path, topic: str) -> Iterator[tuple[int, bytes]]:
    """Yields log time and content of a segment's messages of one topic, in order; ends where it is damaged.

    Raises:
        OSError: the disk fails.
    """
    with path.open("rb") as file:
        try:
            for _, _, message in _reader(file).iter_messages(topics=[topic]):
                yield message.log_time, message.data
        except _DAMAGES:
            return


def _reader(file: BufferedReader) -> Any:
    return SeekingReader(file, validate_crcs=True)


def _summary(path: Path, file: BufferedReader) -> SegmentSummary | None:
    reader = _reader(file)
    index = reader.get_summary()
    if index is None or index.statistics is None:
        return None
    statistics = index.statistics
    channels = tuple(
        ChannelSummary(
            channel.topic,
            index.schemas[channel.schema_id].name if channel.schema_id else "",
            channel.metadata.get(OFFERED_QOS, ""),
            statistics.channel_message_counts.get(number, 0),
        )
        for number, channel in index.channels.items()
    )
    notes = [Note(record.name, record.metadata) for record in reader.iter_metadata()]
    gaps = tuple(gap for note in notes if (gap := gap_of_note(note)))
    file.seek(0)
    content = hashlib.file_digest(file, "sha256")
    count = statistics.message_count
    return SegmentSummary(
        path=path,
        size=file.tell(),
        sha256=content.hexdigest(),
        messages=count,
        channels=channels,
        first_ns=statistics.message_start_time if count else None,
        last_ns=statistics.message_end_time if count else None,
        gaps=gaps,
        numbered=all(note.name != UNNUMBERED for note in notes),
    )
