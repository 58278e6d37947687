"""The end of an MCAP file: end of data, summary with its indexes and statistics, footer."""

import struct
import zlib
from collections.abc import Iterator, Sequence
from typing import Final

from mcap.opcode import Opcode
from mcap.records import (
    ChunkIndex,
    DataEnd,
    Footer,
    McapRecord,
    MetadataIndex,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

from recorder.mcap.records import bytes_of
from recorder.mcap.scan import ChunkRecord, Contents

_FOOTER: Final = struct.Struct("<BQQQ")
_FOOTER_LENGTH: Final = 20


def ending(found: Contents, at: int) -> bytes:
    """Returns what completes a file with these contents, whose data end at that offset."""
    data_end = bytes_of([DataEnd(data_section_crc=0)])
    summary_at = at + len(data_end)
    summary, offsets = b"", []
    for opcode, records in _groups(found):
        group = bytes_of(records)
        if group:
            offsets.append(SummaryOffset(opcode, summary_at + len(summary), len(group)))
        summary += group
    offsets_at = summary_at + len(summary)
    summary += bytes_of(offsets)
    # MCAP, "Footer": the CRC covers the summary and the footer up to the CRC itself.
    crc = zlib.crc32(summary + _FOOTER.pack(Opcode.FOOTER, _FOOTER_LENGTH, summary_at, offsets_at))
    return data_end + summary + bytes_of([Footer(summary_at, offsets_at, crc)]) + MCAP0_MAGIC


def _groups(found: Contents) -> Iterator[tuple[int, Sequence[McapRecord]]]:
    yield Opcode.SCHEMA, list(found.schemas.values())
    yield Opcode.CHANNEL, list(found.channels.values())
    yield Opcode.STATISTICS, [_statistics(found)]
    yield Opcode.CHUNK_INDEX, [_chunk_index(each) for each in found.chunks]
    yield (
        Opcode.METADATA_INDEX,
        [MetadataIndex(each.offset, each.length, each.note.name) for each in found.notes],
    )


def _statistics(found: Contents) -> Statistics:
    return Statistics(
        attachment_count=0,
        channel_count=len(found.channels),
        channel_message_counts=found.counts,
        chunk_count=len(found.chunks),
        message_count=sum(found.counts.values()),
        message_start_time=min(each.first_ns for each in found.chunks),
        message_end_time=max(each.last_ns for each in found.chunks),
        metadata_count=len(found.notes),
        schema_count=len(found.schemas),
    )


def _chunk_index(chunk: ChunkRecord) -> ChunkIndex:
    offsets, at = {}, chunk.offset + chunk.length
    for channel, record in chunk.indexes.items():
        offsets[channel] = at
        at += len(record)
    return ChunkIndex(
        chunk_start_offset=chunk.offset,
        chunk_length=chunk.length,
        message_start_time=chunk.first_ns,
        message_end_time=chunk.last_ns,
        message_index_offsets=offsets,
        message_index_length=at - chunk.offset - chunk.length,
        compression="zstd",
        compressed_size=chunk.compressed_size,
        uncompressed_size=chunk.uncompressed_size,
    )
