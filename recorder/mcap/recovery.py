"""Completes a segment that was not finished: after a crash, a power failure, on a disk from another machine.

| found | done |
|---|---|
| the file ends within a record | cut behind the last whole one |
| garbage or zeros at the end | cut |
| a chunk whose CRC does not hold, or other damage, with whole chunks behind it | hidden from readers; a gap |
| message indexes missing or damaged | written anew from the chunk |
| magic number or header damaged | written anew |
| a channel whose definition was in a damaged chunk | its messages stay, under a made-up topic and type |
| a type whose definition was in one | its messages stay, with a made-up type |
| no whole chunk | nothing is changed |

Repeating an interrupted recovery has the same result.
"""

import hashlib
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, Final

from mcap.records import Channel, Metadata, Schema

from recorder.mcap.records import CDR, OFFERED_QOS, UNNUMBERED, bytes_of, gap_of_note, note_of_gap
from recorder.mcap.scan import RECORD, Contents, NoteRecord, new_head, scan
from recorder.mcap.summary_section import ending
from recorder.mcap.writer import move_into_place
from recorder.values import ChannelSummary, Gap, GapCause, SegmentSummary

PRIVATE: Final = 0x80
"""MCAP leaves opcodes from 0x80 on to applications, and readers skip them: this hides damaged parts."""
UNKNOWN_TOPIC: Final = "/unknown/channel_{}"
"""Topic of messages whose channel's definition is lost."""
UNKNOWN_TYPE: Final = "unknown/msg/Unknown"
"""Type of messages whose schema's definition is lost. `ros2 bag play` leaves out what is not installed."""
_SCHEMA_IDS: Final = range(1, 1 << 16)
"""Those of MCAP; 0 is "none", for which rosbag2 refuses the whole file."""


def recover(part: Path) -> SegmentSummary | None:
    """Completes "NAME.mcap.part" in place and renames it to "NAME.mcap"; returns what it contains.

    All messages up to `last_ns` are in it, but those of its gaps. None if no message is left: then the file
    is as it was.

    Raises:
        FileExistsError: a file has the final name; the segment stays as it is, complete.
        OSError: the disk fails. It can be tried again.
    """
    with part.open("r+b") as file:
        found = scan(file, part.stat().st_size)
        if not found.chunks:
            return None
        repairs = [*found.indexes, *_hidden(found.damages, _unknown_definitions(found))]
        gaps = _write(file, found, repairs)
        file.seek(0)
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        size = file.tell()
    final = part.with_suffix("")
    move_into_place(part, final)
    return SegmentSummary(
        path=final,
        size=size,
        sha256=digest,
        messages=sum(found.counts.values()),
        channels=tuple(_channel_summary(found, each) for each in found.counts),
        first_ns=min(each.first_ns for each in found.chunks),
        last_ns=max(each.last_ns for each in found.chunks),
        gaps=gaps,
        numbered=all(each.note.name != UNNUMBERED for each in found.notes),
    )


def is_untouched(part: Path) -> bool:
    """Returns whether an unfinished segment without a message is undamaged: none was written to it.

    Raises:
        OSError: the disk fails.
    """
    size = part.stat().st_size
    with part.open("rb") as file:
        return scan(file, size).end == size


def _unknown_definitions(found: Contents) -> bytes:
    """Makes up the schemas and channels whose definitions are lost; returns their records."""
    lost = sorted(found.counts.keys() - found.channels.keys())
    unnamed = {each.schema_id for each in found.channels.values()} - found.schemas.keys() - {0}
    if lost:
        taken = found.schemas.keys() | unnamed
        free = next((each for each in _SCHEMA_IDS if each not in taken), 0)
        for each in lost:
            found.channels[each] = Channel(each, UNKNOWN_TOPIC.format(each), CDR, {}, free)
        unnamed |= {free} - {0}
    # MCAP, "Schema": an unknown definition has an empty encoding and no data.
    schemas = {each: Schema(each, b"", "", UNKNOWN_TYPE) for each in sorted(unnamed)}
    found.schemas.update(schemas)
    return bytes_of([*schemas.values(), *(found.channels[each] for each in lost)])


def _hidden(damages: Sequence[tuple[int, int]], definitions: bytes) -> Iterator[tuple[int, bytes]]:
    """Yields where to write what, so that readers skip the damaged parts and find the definitions in one.

    Where a part has no room for them, only readers that begin with the summary find them.
    """
    for begin, end in damages:
        content = b"" if begin else new_head()
        if len(content) + len(definitions) + RECORD.size <= end - begin:
            content, definitions = content + definitions, b""
        filler = end - begin - len(content) - RECORD.size
        yield begin, content + RECORD.pack(PRIVATE, filler)


def _write(file: BinaryIO, found: Contents, repairs: Iterable[tuple[int, bytes]]) -> tuple[Gap, ...]:
    """Cuts, repairs and completes the file, on the disk; returns all gaps."""
    file.truncate(found.end)
    for at, repair in repairs:
        file.seek(at)
        file.write(repair)
    gaps = [gap for each in found.notes if (gap := gap_of_note(each.note))]
    at = found.end
    file.seek(at)
    for gap in _gaps_of_damages(found):
        if gap not in gaps:
            gaps.append(gap)
            at += _append_note(file, gap, at, found)
    file.write(ending(found, at))
    file.flush()
    os.fsync(file.fileno())
    return tuple(gaps)


def _gaps_of_damages(found: Contents) -> list[Gap]:
    """Returns a gap for each damage, between the log times on both sides of it."""
    gaps = []
    for _, end in found.damages:
        behind = next(each for each in found.chunks if each.offset == end)
        before = [each for each in found.chunks if each.offset < end]
        began_ns = before[-1].last_ns if before else behind.first_ns
        gaps.append(Gap("", GapCause.DISK, began_ns, max(began_ns, behind.first_ns), None))
    return gaps


def _append_note(file: BinaryIO, gap: Gap, at: int, found: Contents) -> int:
    note = note_of_gap(gap)
    record = bytes_of([Metadata(note.name, dict(note.values))])
    file.write(record)
    found.notes.append(NoteRecord(at, len(record), note))
    return len(record)


def _channel_summary(found: Contents, number: int) -> ChannelSummary:
    channel = found.channels[number]
    schema = found.schemas.get(channel.schema_id)
    return ChannelSummary(
        topic=channel.topic,
        type=schema.name if schema else "",
        offered_qos=channel.metadata.get(OFFERED_QOS, ""),
        messages=found.counts[number],
    )
