"""What is known of a recording besides its content: one JSON file in its folder, replaced atomically."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Final, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from recorder.mcap.records import note_of_gap
from recorder.store.folder import ID, MANIFEST, SEGMENT, replace_file, segment_number
from recorder.store.gaps import bounded, distinct
from recorder.values import VIDEO_TOPIC, ChannelSummary, Gap, GapCause, Losses, SegmentSummary

_NS_PER_MS: Final = 1_000_000
_MAX_BYTES: Final = 1024 * 1024 * 1024
"""Of a manifest; a segment takes some hundred bytes of it. A longer one counts as damaged."""


class Kind(StrEnum):
    """What made a recording."""

    MANUAL = "manual"
    SNAPSHOT = "snapshot"
    INCIDENT = "incident"
    RUN_BUNDLE = "run_bundle"


class RecordingState(StrEnum):
    """State of a recording."""

    STARTING = "starting"
    RECORDING = "recording"
    FINALISING = "finalising"
    COMPLETE = "complete"
    RECOVERED = "recovered"
    FAULTED = "faulted"

    @property
    def open(self) -> bool:
        """Whether it is still written."""
        return self in (RecordingState.STARTING, RecordingState.RECORDING, RecordingState.FINALISING)


class StopReason(StrEnum):
    """Why a recording ended."""

    REQUESTED = "requested"
    LIMIT = "limit"
    DISK = "disk"
    ERROR = "error"
    SHUTDOWN = "shutdown"
    INTERRUPTED = "interrupted"


class CopyState(StrEnum):
    """Whether a recording is kept elsewhere, too."""

    NONE = "none"
    """Only here, and no copy is wanted."""
    QUEUED = "queued"
    UPLOADING = "uploading"
    VERIFYING = "verifying"
    VERIFIED = "verified"
    PAUSED = "paused"
    FAILED = "failed"


class _Part(BaseModel):
    # Of a later version, unknown keys are no damage.
    model_config = ConfigDict(frozen=True, extra="ignore")


class Copy(_Part):
    """State of the copy elsewhere."""

    state: CopyState = CopyState.NONE
    reason: str = ""
    bytes_done: int = Field(default=0, ge=0)

    @property
    def outstanding(self) -> bool:
        """Whether a copy is wanted and not confirmed yet."""
        return self.state not in (CopyState.NONE, CopyState.VERIFIED)


class Topic(_Part):
    """A topic with one message type that a recording has."""

    name: str
    type: str
    offered_qos: str = ""


class File(_Part):
    """A file that never changes again."""

    name: str = Field(min_length=1, max_length=255)
    size: int = Field(ge=0)
    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")


class Segment(File):
    """One MCAP file of a recording."""

    name: str = Field(pattern=f"^{SEGMENT.pattern}$")
    first_ns: int | None = None
    last_ns: int | None = None
    """Earliest and latest log time; None without messages."""
    counts: Mapping[int, int] = {}
    """Messages by topic: by its position in the manifest, which names each topic once."""
    gaps: tuple[Gap, ...] = ()
    numbered: bool = True

    @property
    def messages(self) -> int:
        """How many messages it has, frames of video included."""
        return sum(self.counts.values())


class Manifest(_Part):
    """A recording.

    Attributes:
        id: as RecordingService defines it.
        ordinal: greater than that of all recordings that were made before on this disk, whatever the calendar
            said; 0 if unknown.
        trigger: who or what caused a snapshot or an incident.
        max_duration_s, max_bytes: where it stops by itself; 0 for no limit.
        numbered: whether the middleware numbers the messages, as far as the segments do not say it.
        gaps: besides those of the segments.
        metadata: rosbag2's file, once the recording has ended.
        window_ns: of a snapshot, what it is to contain: two instants of the calendar clock.
        deleting: whether its deletion has begun.
    """

    id: str = Field(pattern=f"^{ID.pattern}$")
    ordinal: int = Field(default=0, ge=0)
    label: str = ""
    notes: str = ""
    kind: Kind
    state: RecordingState
    stop_reason: StopReason | None = None
    preset: str = ""
    with_video: bool = False
    started_unix_ms: int = Field(default=0, ge=0)
    ended_unix_ms: int = Field(default=0, ge=0)
    started_monotonic_ns: int = Field(default=0, ge=0)
    ended_monotonic_ns: int = Field(default=0, ge=0)
    boot_id: str = ""
    run_id: str = ""
    trigger: str = ""
    max_duration_s: int = Field(default=0, ge=0)
    max_bytes: int = Field(default=0, ge=0)
    pinned: bool = False
    numbered: bool = True
    copied: Copy = Copy()
    topics: tuple[Topic, ...] = ()
    segments: tuple[Segment, ...] = ()
    gaps: tuple[Gap, ...] = ()
    metadata: File | None = None
    window_ns: tuple[int, int] | None = None
    deleting: bool = False

    @property
    def files(self) -> tuple[File, ...]:
        """Its final files: the segments by number, then rosbag2's file."""
        return (*self.segments, self.metadata) if self.metadata else self.segments

    @property
    def size(self) -> int:
        """Bytes of its final files."""
        return sum(file.size for file in self.files)

    @property
    def next_number(self) -> int:
        """The number of its next segment."""
        return max((segment_number(segment.name) + 1 for segment in self.segments), default=0)

    @property
    def messages(self) -> int:
        """Messages in its final segments."""
        return sum(segment.messages for segment in self.segments)

    @property
    def video_frames(self) -> int:
        """Frames of video in its final segments."""
        video = [index for index, topic in enumerate(self.topics) if topic.name == VIDEO_TOPIC]
        return sum(segment.counts.get(index, 0) for index in video for segment in self.segments)

    @property
    def all_gaps(self) -> tuple[Gap, ...]:
        """Its gaps in order, at most 1000; further ones are merged with the last."""
        in_order = sorted(self._gaps, key=lambda gap: (gap.began_ns, gap.ended_ns))
        return tuple(bounded(in_order))

    @property
    def losses(self) -> Losses:
        """What is missing from its final segments, by all of its gaps, however many."""
        numbered = self.numbered and all(segment.numbered for segment in self.segments)
        found = Losses(numbered=numbered)
        for gap in self._gaps:
            found = found.with_loss(gap.cause, gap.messages)
        return found

    @property
    def _gaps(self) -> Iterator[Gap]:
        from_ns = self.window_ns[0] if self.window_ns else None
        return distinct(self.gaps, (gap for segment in self.segments for gap in segment.gaps), from_ns)

    @property
    def sha256(self) -> bytes:
        """SHA-256 over the names and sums of its files; empty while it is written."""
        if self.state.open:
            return b""
        lines = [f"{file.sha256}  {file.name}\n" for file in self.files]
        return hashlib.sha256("".join(lines).encode()).digest()

    @property
    def about(self) -> dict[str, str]:
        """What is known of it besides its content, as texts by name; what is empty is left out."""
        gaps = [dict(note_of_gap(gap).values) for gap in self.all_gaps]
        texts = {
            "id": self.id,
            "kind": self.kind.value,
            "label": self.label,
            "notes": self.notes,
            "preset": self.preset,
            "trigger": self.trigger,
            "state": self.state.value,
            "stop_reason": self.stop_reason.value if self.stop_reason else "",
            "boot_id": self.boot_id,
            "gaps": json.dumps(gaps) if gaps else "",
        }
        return {name: text for name, text in texts.items() if text}

    def with_segment(self, name: str, summary: SegmentSummary) -> Self:
        """Returns the manifest with one more segment, or with one in place of that of the same name."""
        topics = list(self.topics)
        counts = {}
        for channel in summary.channels:
            topic = Topic(name=channel.topic, type=channel.type, offered_qos=channel.offered_qos)
            if topic not in topics:
                topics.append(topic)
            counts[topics.index(topic)] = channel.messages
        added = Segment(
            name=name,
            size=summary.size,
            sha256=summary.sha256,
            first_ns=summary.first_ns,
            last_ns=summary.last_ns,
            counts=counts,
            gaps=summary.gaps,
            numbered=summary.numbered,
        )
        segments = sorted(
            (*(each for each in self.segments if each.name != name), added),
            key=lambda each: segment_number(each.name),
        )
        return self.model_copy(update={"topics": tuple(topics), "segments": tuple(segments)})

    def without_segment(self, name: str) -> Self:
        """Returns the manifest with a gap for an unreadable segment, between the messages beside it.

        It stands for the gap that an earlier look found, when what follows the segment was not there yet.
        """
        number = segment_number(name)
        before = [each.last_ns or 0 for each in self.segments if segment_number(each.name) < number]
        behind = [each.first_ns for each in self.segments if segment_number(each.name) > number]
        began_ns = max((each for each in before if each), default=self.started_unix_ms * _NS_PER_MS)
        ended_ns = min((each for each in behind if each), default=began_ns)
        gap = Gap("", GapCause.DISK, began_ns, max(began_ns, ended_ns), None)
        same = [each for each in self.gaps if replace(each, ended_ns=gap.ended_ns) == gap]
        if any(each.ended_ns >= gap.ended_ns for each in same):
            return self
        others = tuple(each for each in self.gaps if each not in same)
        return self.model_copy(update={"gaps": (*others, gap)})

    def before(self, number: int) -> Self:
        """Returns the manifest without the segments from a number on."""
        kept = tuple(each for each in self.segments if segment_number(each.name) < number)
        return self.model_copy(update={"segments": kept})

    def spanning(self) -> Self:
        """Returns the manifest with the begin and end of its messages where it has none."""
        firsts = [each.first_ns for each in self.segments if each.first_ns is not None]
        lasts = [each.last_ns for each in self.segments if each.last_ns is not None]
        update = {}
        if firsts and not self.started_unix_ms:
            update["started_unix_ms"] = min(firsts) // _NS_PER_MS
        if lasts and not self.ended_unix_ms:
            update["ended_unix_ms"] = max(lasts) // _NS_PER_MS
        return self.model_copy(update=update)

    def summaries(self, folder: Path) -> list[SegmentSummary]:
        """Returns what its segments contain, as they were when they became final."""
        return [
            SegmentSummary(
                path=folder / each.name,
                size=each.size,
                sha256=each.sha256,
                messages=each.messages,
                channels=tuple(
                    ChannelSummary(topic.name, topic.type, topic.offered_qos, each.counts[index])
                    for index, topic in enumerate(self.topics)
                    if index in each.counts
                ),
                first_ns=each.first_ns,
                last_ns=each.last_ns,
                gaps=each.gaps,
                numbered=each.numbered,
            )
            for each in self.segments
        ]

    def write(self, folder: Path) -> None:
        """Writes it to a recording's folder.

        Raises:
            OSError: the disk is full or fails; the former one is as it was.
        """
        replace_file(folder / MANIFEST, self.model_dump_json(indent=1, exclude_defaults=True).encode())


class DamagedManifestError(Exception):
    """A manifest that can't be read; the text says why."""


def read_manifest(folder: Path) -> Manifest:
    """Returns the manifest of a recording's folder.

    Raises:
        DamagedManifestError: it is missing, no manifest, or another recording's.
        OSError: the disk refuses to read it, for now perhaps: that is no damage.
    """
    try:
        with (folder / MANIFEST).open("rb") as file:
            manifest = Manifest.model_validate_json(file.read(_MAX_BYTES))
    except (FileNotFoundError, IsADirectoryError) as error:
        raise DamagedManifestError(f"{error.strerror}") from error
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        raise DamagedManifestError(f"{where}: {first['msg']}" if where else first["msg"]) from error
    if manifest.id != folder.name:
        raise DamagedManifestError(f"it is that of {manifest.id}")
    return manifest


def file_of(name: str, content: bytes) -> File:
    """Returns what is known of a file with this content."""
    return File(name=name, size=len(content), sha256=hashlib.sha256(content).hexdigest())
