"""The robot's connection to its fleet. Sizes are in bytes."""

from dataclasses import dataclass
from enum import Enum

from console.client.results.recording import RecordingCopy


class CloudState(Enum):
    """State of the connection to the fleet's hub."""

    UNKNOWN = "unknown"
    OFFLINE = "offline"
    """The hub is not reached; what is to be sent waits."""
    CONNECTED = "connected"
    REFUSED = "refused"
    """The hub refuses the robot's credential."""
    FAULTED = "faulted"
    """The bridge can't work; `last_error` says why."""
    UNREACHABLE = "unreachable"
    """The gateway does not reach the bridge."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CloudStatus:
    """The connection to the fleet's hub."""

    state: CloudState
    robot: str
    """The name under which the robot is enrolled."""
    fleet: str
    state_age_ms: int
    outbox_events: int
    """Events that wait to be sent."""
    outbox_bytes: int
    outbox_max_bytes: int
    events_dropped: int
    """Since the outbox was made; the next one, too."""
    events_sent: int
    last_sent_age_ms: int | None
    """Age of the newest acknowledgement. None: none since the bridge started."""
    uploads_waiting: int
    """Recordings that wait to be copied or are being copied."""
    uploading_id: str
    """The recording that is being copied; empty for none."""
    uploading: RecordingCopy | None
    uploading_size: int
    """Of that recording."""
    upload_bytes_per_s: int
    uploads_paused: str
    """Why no recording is copied although some wait; else empty."""
    last_error: str
    """Why the hub is not reached or the bridge can't work, and what to do; else empty."""
    uploads_left_out: int
    """Recordings that are to be copied and find no place in the full queue."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CloudEvent:
    """The connection to the fleet's hub settled in another state."""

    state: CloudState
    last_error: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingCopyEvent:
    """A recording has been copied to the fleet's store, or copying it has failed."""

    recording_id: str
    label: str
    """Empty when none was given, or it is not known."""
    copy: RecordingCopy


@dataclass(frozen=True, slots=True, kw_only=True)
class UploadAnswer:
    """The robot's answer to the request to copy a recording to the fleet's store."""

    message: str
    copy: RecordingCopy


@dataclass(frozen=True, slots=True, kw_only=True)
class UploadCancelled:
    """A recording is not to be copied any more."""

    message: str
