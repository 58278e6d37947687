"""What is requested of the recorder, what comes of it, and how far a recording has come. Pure values."""

from dataclasses import dataclass

from recorder.store.manifest import Manifest
from recorder.values import Losses


@dataclass(frozen=True, slots=True)
class StartOptions:
    """What is to be recorded; see StartRecordingRequest."""

    label: str = ""
    notes: str = ""
    preset: str = ""
    with_video: bool | None = None
    max_duration_s: int = 0
    max_bytes: int = 0


@dataclass(frozen=True, slots=True)
class SnapshotOptions:
    """What a snapshot is to contain; None: as configured."""

    pre_s: int | None = None
    post_s: int | None = None
    label: str = ""
    preset: str = ""


@dataclass(frozen=True, slots=True)
class Result:
    """What came of a request: a sentence for people, and the recording."""

    message: str
    recording: Manifest | None


@dataclass(frozen=True, slots=True)
class Live:
    """How far a recording has come. `part` is the name of the unfinished file."""

    duration_ms: int
    messages: int
    frames: int
    losses: Losses
    part: str = ""
    part_bytes: int = 0
