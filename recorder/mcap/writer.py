"""One segment: messages become an MCAP file that stays readable whatever ends the program.

A segment grows as NAME.mcap.part. `flush` ends the chunk and waits for the disk: a power failure costs
at most what came later (`recorder.mcap.recovery` adds the missing index). `finish` renames it to NAME.mcap,
which is complete and never changes again.
"""

import os
from collections.abc import Iterable
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import IO, Any, Final, cast

from mcap.writer import CompressionType, Writer

from common.private_files import sync_directory
from common.version import project_version
from recorder.mcap.records import CDR, OFFERED_QOS, PART, PROFILE, UNNUMBERED, note_of_gap
from recorder.values import (
    VIDEO_TOPIC,
    Channel,
    ChannelSummary,
    Gap,
    Loss,
    Note,
    Sample,
    SegmentSummary,
)

MAX_CHUNK: Final = 1024 * 1024
"""Uncompressed bytes of a chunk; a larger message is a chunk of its own."""
_MODE: Final = 0o640
_UINT32: Final = 0xFFFF_FFFF
"""Sequence numbers of MCAP have 32 bits, those of DDS 64."""
_MAX_TIME_NS: Final = 0xFFFF_FFFF_FFFF_FFFF
"""Times of MCAP have 64 bits and no sign."""


class SegmentWriter:
    """Writes one segment. For one thread. After an OSError only `abandon` may be called.

    Args:
        path: of the file while it grows: "NAME.mcap.part". It must not exist.
        head: notes at the beginning of the file.

    Raises:
        OSError: the file exists or can't be written; so do all methods, but `abandon`.
    """

    def __init__(self, path: Path, *, head: Iterable[Note] = ()) -> None:
        if path.suffix != PART:
            raise ValueError(f"a growing segment is named *{PART}, not {path.name}")
        self._path = path
        self._file = _HashedFile(path)
        # Chunks end where this class says: the library would look only after a message has been added.
        self._mcap = Writer(cast("IO[Any]", self._file), chunk_size=1 << 62, compression=CompressionType.ZSTD)
        self._pending = 0
        self._schemas: dict[tuple[str, bytes], int] = {}
        self._channels: dict[Channel, int] = {}
        self._counts: dict[Channel, int] = {}
        self._first_ns: int | None = None
        self._last_ns: int | None = None
        self._messages = 0
        self._gaps: list[Gap] = []
        self._numbered = True
        try:
            self._mcap.start(profile=PROFILE, library=f"robot-gateway {project_version()}")
            for each in head:
                self.note(each)
        except OSError:
            # No caller gets the object to abandon, and the file is empty.
            self.abandon()
            path.unlink(missing_ok=True)
            raise

    @property
    def size(self) -> int:
        """Bytes of the file so far, and of the chunk that is not compressed yet."""
        return self._file.size + self._pending

    def write(self, sample: Sample) -> None:
        """Adds a message; a full chunk goes to the file."""
        if self._pending and self._pending + len(sample.data) > MAX_CHUNK:
            self._end_chunk()
        if self._numbered and not sample.sequence and sample.channel.topic != VIDEO_TOPIC:
            # Before the message itself is on the disk: what is recovered says it, too.
            self._numbered = False
            self.note(Note(UNNUMBERED, {"topic": sample.channel.topic}))
        channel, at_ns = sample.channel, min(max(sample.log_time_ns, 0), _MAX_TIME_NS)
        published_ns = sample.publish_time_ns
        if not 0 <= published_ns <= _MAX_TIME_NS:
            # Fast DDS says -1 where the publisher sends no time, and a peer may send any. MCAP, "Message":
            # without a publish time it is the log time.
            published_ns = at_ns
        self._mcap.add_message(
            self._channels.get(channel) or self._register(channel),
            at_ns,
            sample.data,
            published_ns,
            sample.sequence & _UINT32,
        )
        self._pending += len(sample.data)
        self._messages += 1
        self._counts[channel] += 1
        if self._first_ns is None or self._last_ns is None:
            self._first_ns = self._last_ns = at_ns
        elif at_ns > self._last_ns:
            self._last_ns = at_ns
        elif at_ns < self._first_ns:
            self._first_ns = at_ns

    def note(self, note: Note) -> None:
        """Adds a metadata record."""
        self._mcap.add_metadata(note.name, dict(note.values))

    def loss(self, loss: Loss) -> None:
        """Adds a metadata record "gap"."""
        topic = loss.channel.topic if loss.channel else ""
        gap = Gap(topic, loss.cause, loss.began_ns, loss.ended_ns, loss.messages)
        self._gaps.append(gap)
        self.note(note_of_gap(gap))

    def flush(self) -> None:
        """Ends the chunk and waits until everything so far is on the disk (fdatasync(2))."""
        self._end_chunk()
        self._file.sync()

    def finish(self) -> SegmentSummary:
        """Completes the file, on the disk, under its final name, and returns what it contains.

        Raises:
            FileExistsError: a file has the final name; the segment stays as it is.
        """
        final = self._path.with_suffix("")
        self._mcap.finish()
        self._file.sync()
        self._file.close()
        move_into_place(self._path, final)
        return SegmentSummary(
            path=final,
            size=self._file.size,
            sha256=self._file.sha256,
            messages=self._messages,
            channels=tuple(
                ChannelSummary(each.topic, each.type, each.offered_qos, count)
                for each, count in self._counts.items()
            ),
            first_ns=self._first_ns,
            last_ns=self._last_ns,
            gaps=tuple(self._gaps),
            numbered=self._numbered,
        )

    def abandon(self) -> None:
        """Closes the file as it is, for recovery. Never raises."""
        with suppress(OSError):
            self._file.close()

    def _end_chunk(self) -> None:
        self._mcap.flush()
        self._pending = 0

    def _register(self, channel: Channel) -> int:
        key = (channel.type, channel.schema)
        if key not in self._schemas:
            self._schemas[key] = self._mcap.register_schema(*_schema_record(channel))
        self._channels[channel] = number = self._mcap.register_channel(
            channel.topic, CDR, self._schemas[key], {OFFERED_QOS: channel.offered_qos}
        )
        self._counts[channel] = 0
        return number


def _schema_record(channel: Channel) -> tuple[str, str, bytes]:
    # MCAP, "Schema": an unknown definition has an empty encoding and no data; the name of the type stays.
    return channel.type, channel.schema_encoding if channel.schema else "", channel.schema


def move_into_place(part: Path, final: Path) -> None:
    """Gives a complete segment its final name, which then survives a power failure.

    Raises:
        FileExistsError: a file has that name. The directory has one owner, so that none comes in between.
        OSError: the disk fails.
    """
    if final.exists():
        raise FileExistsError(f"{final} exists and is not overwritten")
    part.rename(final)
    sync_directory(final.parent)


class _HashedFile:
    """A new file that is hashed as it is written: what `mcap.writer.Writer` needs of a stream."""

    def __init__(self, path: Path) -> None:
        self._handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, _MODE)
        self._hash = sha256()
        self.size = 0

    @property
    def sha256(self) -> str:
        return self._hash.hexdigest()

    def write(self, data: bytes) -> int:
        rest = memoryview(data)
        while rest:
            rest = rest[os.write(self._handle, rest) :]
        self._hash.update(data)
        self.size += len(data)
        return len(data)

    def tell(self) -> int:
        return self.size

    def flush(self) -> None:
        """Does nothing: nothing is buffered."""

    def sync(self) -> None:
        os.fdatasync(self._handle)

    def close(self) -> None:
        if self._handle >= 0:
            handle, self._handle = self._handle, -1
            os.close(handle)
