"""What the recorder reads of others: the preview's records, a disk's segments, requests for exports."""

import asyncio
import struct
import zlib
from contextlib import ExitStack, suppress
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any, Final

import zstandard
from google.protobuf.message import DecodeError
from mcap.opcode import Opcode
from mcap.records import Metadata

from common.errors import DomainError
from common.video_tap import HEADER_BYTES, MalformedRecordError, decode_header
from omniseer.gateway.v1 import recording_pb2 as pb
from recorder.config import RecorderSettings
from recorder.mcap.reading import summarise
from recorder.mcap.records import bytes_of
from recorder.mcap.recovery import recover
from recorder.mcap.scan import RECORD, new_head
from recorder.recording.assembly import build
from recorder.recording.status_reader import StatusReader
from recorder.rpc.servicer import RecorderServicer
from recorder.store.manifest import Kind, Manifest, RecordingState, StopReason
from recorder.store.readers import reader_threads
from recorder.values import Loss, Note, Sample
from recorder.video.message import decode
from recorder.video.stream import Now, Stream, channel
from recorder.writing.queue import SampleQueue
from tests.support.recorder_in_process import LatchedMessages, NoSources
from tests.support.segments import indexed_log_times, unfinished_segment

NOW: Final = Now(monotonic_ns=10**12, calendar_ns=17 * 10**17)
RECORDING: Final = "20260101T120000Z-abcdef"
FILE: Final = "data/000000.mcap"
_IN_MEMORY: Final = "/dev/shm"  # noqa: S108  # a directory of a random name in it
_ADDED: Final = 64 * 1024
"""Bytes that recovery may add to a segment: indexes, and a summary."""


def video_tap(data: bytes) -> None:
    """Records of the video tap, one after the other: what comes of them can be written."""
    stream, at = Stream(channel(frozenset()), NOW), 0
    try:
        while at + HEADER_BYTES <= len(data):
            header = decode_header(data[at : at + HEADER_BYTES])
            begin = at + HEADER_BYTES
            at = begin + header.length
            if at > len(data):
                break
            for item in stream.take(header, data[begin:at], NOW):
                _check_item(item, data[begin:at])
    except MalformedRecordError:
        stream.disconnected(NOW)
    for item in stream.end(NOW):
        _check_item(item, b"")


def segment(data: bytes) -> None:
    """A file on a disk that was pulled from a robot: recovered, it opens in readers, or it is left as it is.

    With an odd first byte the rest is the content of a chunk, whose CRC holds. No damage makes that, so that
    readers need not find all of its messages.
    """
    content, forged = data[1:], bool(data and data[0] & 1)
    if forged:
        content = new_head() + chunk_of(content)
    with TemporaryDirectory(dir=_IN_MEMORY) as directory:
        part = Path(directory) / "000000.mcap.part"
        part.write_bytes(content)
        found = recover(part)
        if found is None:
            assert part.read_bytes() == content
            return
        assert found.size == found.path.stat().st_size <= len(content) + _ADDED
        again = summarise(found.path)
        if not forged:
            assert len(indexed_log_times(found.path)) == found.messages
            assert again
            assert again.messages == found.messages


def export_request(data: bytes) -> None:
    """A request for an export: the bytes of a file of the recording from its offset on, or a refusal."""
    request = pb.ExportRecordingRequest()
    with suppress(DecodeError):
        request.ParseFromString(data)
        # A rate of a byte a second is no hang.
        request.max_bytes_per_s = 0
        loop, _, servicer, content = _robot()
        with suppress(DomainError):
            received = loop.run_until_complete(_exported(servicer, request))
            assert (request.recording_id, request.file) == (RECORDING, FILE)
            assert received == content[request.offset :]


def chunk_of(content: bytes) -> bytes:
    """Returns a chunk with this content, as the recorder writes them, and with the times of its messages."""
    times = _log_times(content) or [0]
    compressed = zstandard.ZstdCompressor().compress(content)
    body = struct.pack("<QQQI", min(times), max(times), len(content), zlib.crc32(content))
    body += struct.pack("<I4sQ", 4, b"zstd", len(compressed)) + compressed
    return RECORD.pack(Opcode.CHUNK, len(body)) + body


def unfinished() -> bytes:
    """Returns a segment as a killed recorder leaves it."""
    with TemporaryDirectory(dir=_IN_MEMORY) as directory:
        return unfinished_segment(Path(directory) / "000000.mcap.part", (2, 3)).read_bytes()


def _log_times(content: bytes) -> list[int]:
    times, at = [], 0
    while at + RECORD.size <= len(content):
        opcode, length = RECORD.unpack_from(content, at)
        at += RECORD.size
        if opcode == Opcode.MESSAGE and at + 14 <= len(content):
            times.append(struct.unpack_from("<Q", content, at + 6)[0])
        at += length
    return times


def _check_item(item: object, payload: bytes) -> None:
    match item:
        case Sample():
            frame = decode(item.data)
            assert frame
            assert frame.unit == payload
        case Loss():
            assert item.began_ns <= item.ended_ns
            assert item.messages is None or item.messages >= 0
        case Note():
            bytes_of([Metadata(item.name, dict(item.values))])


async def _exported(servicer: RecorderServicer, request: pb.ExportRecordingRequest) -> bytes:
    context: Any = SimpleNamespace(invocation_metadata=tuple)  # without a connection for the file
    parts = servicer.ExportRecording(request, context)
    return b"".join([each.chunk.data async for each in parts])


@cache
def _robot() -> tuple[asyncio.AbstractEventLoop, ExitStack, RecorderServicer, bytes]:
    """Returns a loop, a recorder with one recording of one file in what is kept, and the file's content."""
    kept = ExitStack()
    root = Path(kept.enter_context(TemporaryDirectory(dir=_IN_MEMORY)))
    readers = kept.enter_context(reader_threads())
    loop = asyncio.new_event_loop()

    async def made() -> tuple[RecorderServicer, bytes]:
        settings = RecorderSettings(root=root)
        parts = build(
            settings,
            SampleQueue(settings.queue_bytes),
            NoSources(),
            LatchedMessages(),
            boot_id="",
            run_id="a",
        )
        manifest = Manifest(
            id=RECORDING, kind=Kind.MANUAL, state=RecordingState.COMPLETE, stop_reason=StopReason.REQUESTED
        )
        folder = parts.catalogue.create(manifest)
        found = recover(unfinished_segment(folder / f"{FILE}.part", (2, 3)))
        assert found
        parts.catalogue.write(manifest.with_segment(FILE, found))
        operations: Any = None
        servicer = RecorderServicer(operations, StatusReader(parts), settings, readers)
        return servicer, found.path.read_bytes()

    servicer, content = loop.run_until_complete(made())
    return loop, kept, servicer, content
