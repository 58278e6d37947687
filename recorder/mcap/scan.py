"""Reads a segment that was not finished, or was damaged, from its beginning: what of it is whole, and where.

Only what the recorder writes is expected between a segment's header and its end (MCAP, "Data section"):
metadata records, and chunks compressed by zstd, each followed by its message indexes. A chunk is whole if the
CRC of its content holds.
"""

import struct
import zlib
from dataclasses import dataclass, field
from io import BytesIO
from typing import BinaryIO, Final

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Channel, Header, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from common.version import project_version
from recorder.mcap.records import PROFILE, bytes_of
from recorder.values import Note

RECORD: Final = struct.Struct("<BQ")
"""The beginning of each record: opcode, and length of what follows."""
_CHUNK: Final = struct.Struct("<QQQI")
"""Of a chunk: first and last log time, size and CRC of the content; then compression and content."""
_ZSTD: Final = struct.pack("<I", 4) + b"zstd"
_SIZE: Final = struct.Struct("<Q")
_MESSAGE: Final = struct.Struct("<HIQQ")
"""Of a message: channel, sequence, log time, publish time; then its data."""
_MAX_CONTENT: Final = 1 << 30
"""Content of a chunk, in bytes. Chunks exceed 1 MiB only for a message that does."""
_WINDOW: Final = 4 * 1024 * 1024


@dataclass(frozen=True, slots=True)
class ChunkRecord:
    """A whole chunk. Its message indexes follow it in the file."""

    offset: int
    length: int
    """Of the record with its beginning."""
    first_ns: int
    last_ns: int
    compressed_size: int
    uncompressed_size: int
    entries: dict[int, list[int]]
    """By channel: log time and offset in the content, in turns, of each message."""

    @property
    def indexes(self) -> dict[int, bytes]:
        """The message index record of each channel."""
        return {channel: _message_index(channel, entries) for channel, entries in self.entries.items()}


@dataclass(frozen=True, slots=True)
class NoteRecord:
    """A whole metadata record."""

    offset: int
    length: int
    note: Note


@dataclass(slots=True)
class Contents:
    """What is whole, and what between it is not."""

    end: int = 0
    """Offset behind the last whole record."""
    chunks: list[ChunkRecord] = field(default_factory=list)
    notes: list[NoteRecord] = field(default_factory=list)
    damages: list[tuple[int, int]] = field(default_factory=list)
    """Begin and end of each part that can't be read; a whole chunk follows each."""
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    """Messages by channel."""
    indexes: list[tuple[int, bytes]] = field(default_factory=list)
    """Offsets and content of message indexes that are damaged or missing."""


def scan(file: BinaryIO, size: int) -> Contents:
    """Returns what is whole in the file of that size, which is only read.

    Raises:
        OSError: the disk fails.
    """
    found = Contents()
    at = found.end = _head_length(file, size)
    while at < size:
        behind = _take(file, at, size, found)
        if behind is not None:
            found.end = at = behind
            continue
        resumed = _next_chunk(file, at, size)
        if resumed is None:
            break
        found.damages.append((at, resumed))
        at = resumed
    return found


def new_head() -> bytes:
    """Returns magic number and header."""
    return bytes(MCAP0_MAGIC + bytes_of([Header(PROFILE, f"robot-gateway {project_version()}")]))


def _head_length(file: BinaryIO, size: int) -> int:
    """Returns the length of magic number and header; 0 if they are damaged."""
    if _read(file, 0, len(MCAP0_MAGIC)) != MCAP0_MAGIC:
        return 0
    record = _record(file, len(MCAP0_MAGIC), size)
    if record is None or record[0] != Opcode.HEADER or not _is_header(record[1]):
        return 0
    return len(MCAP0_MAGIC) + RECORD.size + len(record[1])


def _is_header(body: bytes) -> bool:
    """Returns whether readers can read a header with this body. There is no CRC to ask."""
    stream = ReadDataStream(BytesIO(body))
    try:
        Header.read(stream)
    except (EndOfFile, UnicodeDecodeError, struct.error):
        return False
    return bool(stream.count == len(body))


def _record(file: BinaryIO, at: int, size: int) -> tuple[int, bytes] | None:
    """Returns opcode and body of the record there; None if the file ends before it does."""
    begin = _read(file, at, RECORD.size)
    if len(begin) < RECORD.size:
        return None
    opcode, length = RECORD.unpack(begin)
    if length > size - at - RECORD.size:
        return None
    return opcode, _read(file, at + RECORD.size, length)


def _read(file: BinaryIO, at: int, length: int) -> bytes:
    file.seek(at)
    return file.read(length)


def _take(file: BinaryIO, at: int, size: int, found: Contents) -> int | None:
    """Adds the record there and returns the offset behind it; None if it is damaged or ends the data."""
    record = _record(file, at, size) if at else None
    if record is None:
        return None
    opcode, body = record
    behind = at + RECORD.size + len(body)
    match opcode:
        case Opcode.CHUNK:
            chunk = _chunk(at, body, found)
            return None if chunk is None else _take_chunk(file, chunk, found)
        case Opcode.METADATA:
            note = _note(body)
            if note is None:
                return None
            found.notes.append(NoteRecord(at, RECORD.size + len(body), note))
            return behind
        case _:
            # DATA_END as well: no whole chunk follows it, so that the data ends there.
            return None


def _take_chunk(file: BinaryIO, chunk: ChunkRecord, found: Contents) -> int:
    found.chunks.append(chunk)
    for channel, entries in chunk.entries.items():
        found.counts[channel] = found.counts.get(channel, 0) + len(entries) // 2
    behind = chunk.offset + chunk.length
    indexes = b"".join(chunk.indexes.values())
    if _read(file, behind, len(indexes)) != indexes:
        found.indexes.append((behind, indexes))
    return behind + len(indexes)


def _chunk(at: int, body: bytes, found: Contents) -> ChunkRecord | None:
    """Returns the chunk with that record's body, and adds what it defines; None if it is damaged."""
    data_at = _CHUNK.size + len(_ZSTD) + _SIZE.size
    if len(body) < data_at or body[_CHUNK.size : _CHUNK.size + len(_ZSTD)] != _ZSTD:
        return None
    first_ns, last_ns, uncompressed_size, crc = _CHUNK.unpack_from(body)
    (compressed_size,) = _SIZE.unpack_from(body, data_at - _SIZE.size)
    if compressed_size != len(body) - data_at:
        return None
    content = _decompressed(memoryview(body)[data_at:], uncompressed_size)
    if content is None or zlib.crc32(content) != crc:
        return None
    entries = _entries(content, found)
    if not entries:
        return None
    times = [time_ns for each in entries.values() for time_ns in each[::2]]
    if (first_ns, last_ns) != (min(times), max(times)):
        return None  # the CRC covers the content alone
    return ChunkRecord(
        at, RECORD.size + len(body), first_ns, last_ns, compressed_size, uncompressed_size, entries
    )


def _decompressed(data: memoryview, size: int) -> bytes | None:
    try:
        # The size that zstd's own header promises is allocated before anything is checked.
        if not 0 < size <= _MAX_CONTENT or zstandard.frame_content_size(data) != size:
            return None
        return zstandard.ZstdDecompressor().decompress(data)
    except zstandard.ZstdError:
        return None


def _entries(content: bytes, found: Contents) -> dict[int, list[int]] | None:
    """Returns log times and offsets of the messages by channel, and adds what the content defines."""
    entries: dict[int, list[int]] = {}
    at, end = 0, len(content)
    while at < end - RECORD.size:
        opcode, length = RECORD.unpack_from(content, at)
        body_at = at + RECORD.size
        if length > end - body_at:
            return None
        if opcode == Opcode.MESSAGE and length >= _MESSAGE.size:
            channel, _, log_ns, _ = _MESSAGE.unpack_from(content, body_at)
            entries.setdefault(channel, []).extend((log_ns, at))
        elif not _define(opcode, content[body_at : body_at + length], found):
            return None
        at = body_at + length
    return entries if at == end else None


def _define(opcode: int, body: bytes, found: Contents) -> bool:
    """Adds a schema or channel; returns whether the record is one."""
    stream = ReadDataStream(BytesIO(body))
    try:
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            found.schemas.setdefault(schema.id, schema)
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            found.channels.setdefault(channel.id, channel)
        else:
            return False
    except (EndOfFile, UnicodeDecodeError, struct.error):
        return False
    return True


def _note(body: bytes) -> Note | None:
    """Returns the metadata with that record's body; None if it is damaged. There is no CRC to ask."""
    stream = ReadDataStream(BytesIO(body))
    try:
        metadata = Metadata.read(stream)
    except (EndOfFile, UnicodeDecodeError, struct.error):
        return None
    # Blocks that were allocated but not written before a power failure read as zeros.
    zeros = "\0" in metadata.name or any("\0" in key + value for key, value in metadata.metadata.items())
    if stream.count != len(body) or not metadata.name or zeros:
        return None
    return Note(metadata.name, metadata.metadata)


def _next_chunk(file: BinaryIO, damaged_at: int, size: int) -> int | None:
    """Returns the offset of the first whole chunk behind the damage; None if there is none."""
    # In between there must be room for a record that hides the damage, and for a new head if that is lost.
    begin = damaged_at + RECORD.size + (0 if damaged_at else len(new_head()))
    signature_at = RECORD.size + _CHUNK.size
    window_at = begin + signature_at
    while window_at < size:
        window = _read(file, window_at, _WINDOW + len(_ZSTD) - 1)
        found = window.find(_ZSTD)
        while found >= 0:
            at = window_at + found - signature_at
            record = _record(file, at, size)
            if record and record[0] == Opcode.CHUNK and _chunk(at, record[1], Contents()):
                return at
            found = window.find(_ZSTD, found + 1)
        window_at += _WINDOW
    return None


def _message_index(channel: int, entries: list[int]) -> bytes:
    # Of one call per index: the library's takes one per number.
    length = 8 * len(entries)
    return RECORD.pack(Opcode.MESSAGE_INDEX, 6 + length) + struct.pack(
        f"<HI{len(entries)}Q", channel, length, *entries
    )
