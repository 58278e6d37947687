"""Recordings on the robot's disk. Sizes are in bytes; `unix_ms` is ms since 1970 UTC by the robot's clock."""

from dataclasses import dataclass
from enum import Enum


class RecorderState(Enum):
    """State of the recorder."""

    UNKNOWN = "unknown"
    IDLE = "idle"
    STARTING = "starting"
    RECORDING = "recording"
    FINALISING = "finalising"
    RECOVERING = "recovering"
    """Recordings that were cut off are being recovered, at its start."""
    FAULTED = "faulted"
    """It can't record; `last_error` says why."""
    UNREACHABLE = "unreachable"
    """The gateway does not reach it. What it records at present goes on."""


class RecordingKind(Enum):
    """What made a recording."""

    UNKNOWN = "unknown"
    MANUAL = "manual"
    SNAPSHOT = "snapshot"
    INCIDENT = "incident"
    """A snapshot that the robot made by itself because of a fault."""
    RUN_BUNDLE = "run-bundle"
    """A folder of the robot's own experiments. Read-only."""


class RecordingState(Enum):
    """State of a recording."""

    UNKNOWN = "unknown"
    STARTING = "starting"
    RECORDING = "recording"
    FINALISING = "finalising"
    COMPLETE = "complete"
    RECOVERED = "recovered"
    """It was cut off, and what had been written was recovered."""
    FAULTED = "faulted"
    """It ended by an error of the disk."""


class RecordingStopReason(Enum):
    """Why a recording ended."""

    UNKNOWN = "unknown"
    """It has not ended."""
    REQUESTED = "requested"
    LIMIT = "limit"
    """It has reached its longest duration or its largest size."""
    DISK = "disk"
    """The disk has no more room."""
    ERROR = "error"
    """The disk reported an error."""
    SHUTDOWN = "shutdown"
    INTERRUPTED = "interrupted"
    """The recorder or the robot's computer ended without warning."""


class RecordingCopyState(Enum):
    """Whether a recording is kept elsewhere, too."""

    UNKNOWN = "unknown"
    """No copy is wanted."""
    QUEUED = "queued"
    UPLOADING = "uploading"
    VERIFYING = "verifying"
    VERIFIED = "verified"
    PAUSED = "paused"
    FAILED = "failed"


class RecordingGapCause(Enum):
    """Why something is missing from a recording."""

    UNKNOWN = "unknown"
    MIDDLEWARE = "middleware"
    QUEUE = "queue"
    """The disk was slower than the messages."""
    INTERRUPTED = "interrupted"
    VIDEO = "video"
    DISK = "disk"


class RecordingChange(Enum):
    """What happened to a recording."""

    UNKNOWN = "unknown"
    STARTED = "started"
    ENDED = "ended"
    SNAPSHOT_COMPLETE = "snapshot-complete"
    LOSS = "loss"
    """Messages were lost from it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingPreset:
    """What can be recorded."""

    name: str
    description: str
    with_video: bool
    bytes_per_minute: int
    """As measured; 0 before it was recorded for the first time."""
    in_ring: bool
    """Whether snapshots of it can be made."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingStatus:
    """The recorder at one instant."""

    state: RecorderState
    recording_id: str
    """The recording that runs; empty without one."""
    label: str
    preset: str
    elapsed_ms: int
    size: int
    messages_written: int
    messages_lost: int | None
    """As far as they were counted; None where it is unknown how many."""
    uncounted_gaps: int
    """Gaps of unknown size, which are not in that number."""
    video: bool
    bytes_per_s: int
    """Written at present, the ring included."""
    room_bytes: int
    """May be written before something has to be deleted or recording stops."""
    room_s: int | None
    """How long it can record at the present rate, with what may be deleted; None while nothing is written."""
    ring_s: int
    """Seconds that the ring holds; 0 without a ring."""
    snapshots_pending: int
    recordings: int
    to_copy: int
    last_error: str
    """Why it can't record, and what to do; empty when all is well."""
    presets: tuple[RecordingPreset, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingCopy:
    """State of the copy elsewhere."""

    state: RecordingCopyState
    reason: str
    bytes_done: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingGap:
    """Something is missing from a recording."""

    cause: RecordingGapCause
    began_unix_ms: int
    ended_unix_ms: int
    messages: int | None
    """Messages lost; None if unknown."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingFile:
    """A file of a recording."""

    name: str
    """With "/" between folders, as the robot names it: check it before it becomes a path."""
    size: int
    sha256: bytes
    """Of its content; empty while it is not final."""
    final: bool
    """Whether it never changes again; only such files are exported."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """A recording. In lists without `files` and `gaps`."""

    id: str
    label: str
    notes: str
    kind: RecordingKind
    state: RecordingState
    stop_reason: RecordingStopReason
    preset: str
    started_unix_ms: int
    ended_unix_ms: int
    """0 while it is written."""
    started_monotonic_ns: int
    """On the monotonic clock of the robot, during the boot `boot_id`."""
    ended_monotonic_ns: int
    boot_id: str
    recorder_run_id: str
    duration_ms: int
    """While it is written, so far."""
    size: int
    messages_written: int
    messages_lost: int | None
    """As far as they were counted; None where it is unknown how many."""
    uncounted_gaps: int
    """Gaps of unknown size, which are not in that number."""
    video_frames: int
    trigger: str
    """What caused a snapshot or an incident; empty otherwise."""
    pinned: bool
    copy: RecordingCopy
    file_count: int
    gap_count: int
    files: tuple[RecordingFile, ...]
    gaps: tuple[RecordingGap, ...]
    sha256: bytes
    """Over its list of files; empty while it is written."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingAnswer:
    """The robot's answer to a start, a stop, a snapshot or a pin."""

    message: str
    recording: Recording


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingPage:
    """A page of the list, the newest recording first."""

    recordings: tuple[Recording, ...]
    next_page_token: str
    """Empty: this is the last one."""
    status: RecordingStatus


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingFound:
    """One recording with a page of its files; on the first page with its gaps, too."""

    recording: Recording
    next_page_token: str
    """Empty: these were the last files."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingDeleted:
    """A recording is deleted."""

    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingThumbnail:
    """A coded key frame of a recording, to be decoded by the receiver."""

    key_frame: bytes
    """With its parameter sets, as an Annex B byte stream."""
    format: str
    """Either "h264" or "h265"."""
    captured_unix_ms: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportHeader:
    """What follows in an export."""

    size: int
    """Of the whole file."""
    sha256: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportChunk:
    """Bytes of a file."""

    offset: int
    data: bytes
    crc32c: int
    """RFC 3720 B.4, of `data`."""
