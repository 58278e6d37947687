"""The queue of uploads: one table of transitions, and the order.

Pure: knows no disk, network or clock. `step` takes an upload, an event and the time, and returns the
upload after it. An event that the table does not list for the state is a defect of the caller: it raises an
error that names both.

Order: incidents, then pinned recordings, then those that an operator or the hub requested, then others; among
equals the oldest recording first, because it is what the robot deletes first. A more urgent recording takes
the place of one that is being uploaded, which costs at most one part.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum, IntEnum
from types import MappingProxyType
from typing import Final, Protocol

from common.backoff import pause_s

MOST_WAITING: Final = 1000
"""Recordings in the queue; a further one is refused, or takes the place of a less urgent one."""
MOST_KEPT: Final = 10_000
"""Recordings of which it is remembered that they are verified or were cancelled; the oldest verified ones are
forgotten first."""
FIRST_PAUSE_S: Final = 1.0
LONGEST_PAUSE_S: Final = 300.0
MOST_CUTS: Final = 3
"""In succession and without progress: from then on a recording counts as the one that fails."""


class State(Enum):
    """State of a recording's copy."""

    LOCAL = "local"
    """Only on the robot: not in the queue, or taken from it; then no rule puts it back."""
    QUEUED = "queued"
    UPLOADING = "uploading"
    VERIFYING = "verifying"
    """All bytes are in the store, and a receiver reads them again."""
    VERIFIED = "verified"
    """A receipt was checked."""
    PAUSED = "paused"
    """A gate is closed; `reason` says which."""
    FAILED = "failed"
    """The last attempt failed; `reason` says why. It is tried again at `due_s`."""


class Event(Enum):
    """Event that may change the state."""

    ENQUEUE = "enqueue"
    """A rule, an operator or the hub requests the copy."""
    BEGIN = "begin"
    SENT = "sent"
    """The store has all bytes."""
    CONFIRMED = "confirmed"
    """A receipt of the whole recording was checked."""
    GIVE_WAY = "give way"
    """To a more urgent recording."""
    PAUSE = "pause"
    """A gate has closed."""
    RESUME = "resume"
    """The gates are open, or the pause after a failure has passed."""
    FAILURE = "failure"
    """Of this recording; it alone is tried again later."""
    CUT = "cut"
    """The gateway, the hub or the store fails, and with it all of the queue; or only at this recording."""
    RESTART = "restart"
    """The bridge was started again."""
    CHANGED = "changed"
    """The recording has other content than the one that was verified."""
    REMOVE = "remove"
    """It was cancelled."""


_TABLE: Final = {
    State.LOCAL: {Event.ENQUEUE: State.QUEUED, Event.RESTART: State.LOCAL},
    State.QUEUED: {
        Event.ENQUEUE: State.QUEUED,
        Event.BEGIN: State.UPLOADING,
        Event.PAUSE: State.PAUSED,
        Event.RESTART: State.QUEUED,
        Event.REMOVE: State.LOCAL,
    },
    State.UPLOADING: {
        Event.ENQUEUE: State.UPLOADING,
        Event.SENT: State.VERIFYING,
        # The hub has had the recording already.
        Event.CONFIRMED: State.VERIFIED,
        Event.GIVE_WAY: State.QUEUED,
        Event.PAUSE: State.PAUSED,
        Event.FAILURE: State.FAILED,
        Event.CUT: State.FAILED,
        Event.RESTART: State.QUEUED,
        Event.REMOVE: State.LOCAL,
    },
    State.VERIFYING: {
        Event.ENQUEUE: State.VERIFYING,
        Event.CONFIRMED: State.VERIFIED,
        Event.GIVE_WAY: State.QUEUED,
        Event.PAUSE: State.PAUSED,
        Event.FAILURE: State.FAILED,
        Event.CUT: State.FAILED,
        Event.RESTART: State.QUEUED,
        Event.REMOVE: State.LOCAL,
    },
    State.PAUSED: {
        # Requested once more: the gates apply all the same.
        Event.ENQUEUE: State.PAUSED,
        Event.PAUSE: State.PAUSED,
        Event.RESUME: State.QUEUED,
        Event.RESTART: State.QUEUED,
        Event.REMOVE: State.LOCAL,
    },
    State.FAILED: {
        Event.ENQUEUE: State.QUEUED,
        Event.RESUME: State.QUEUED,
        Event.RESTART: State.QUEUED,
        Event.REMOVE: State.LOCAL,
    },
    State.VERIFIED: {
        Event.ENQUEUE: State.VERIFIED,
        Event.CHANGED: State.QUEUED,
        Event.RESTART: State.VERIFIED,
        Event.REMOVE: State.LOCAL,
    },
}
TRANSITIONS: Final[Mapping[State, Mapping[Event, State]]] = MappingProxyType(_TABLE)
WAITING: Final = frozenset(State) - {State.LOCAL, State.VERIFIED}
"""States of recordings that still have to be copied."""
RUNNING: Final = frozenset({State.UPLOADING, State.VERIFYING})


class Priority(IntEnum):
    """How urgent a copy is; the lowest number goes first."""

    INCIDENT = 0
    PINNED = 1
    BY_HAND = 2
    OTHER = 3


class IllegalEventError(Exception):
    """Event without a transition from the current state."""

    def __init__(self, state: State, event: Event) -> None:
        super().__init__(f"'{event.value}' can't happen to an upload that is {state.value}")
        self.state = state
        self.event = event


@dataclass(frozen=True, slots=True, kw_only=True)
class Upload:
    """A recording and where its copy stands.

    Attributes:
        recording_id: Which.
        label: Its name for people.
        priority: How urgent it is.
        started_unix_ms: Begin of the recording by the robot's clock, in ms since 1970 UTC.
        size: Of the recording, in bytes.
        sha256: Of its list of files; empty while that is not known.
        state: Where it stands.
        reason: Why it rests or has failed, for people. Otherwise empty.
        bytes_done: Bytes that the store has.
        failures: FAILURE events in succession.
        cuts: CUT events in succession, without progress; not kept over a restart.
        due_s: When a failed one is tried again; monotonic seconds, and so not kept over a restart.
        since_s: Since when it has its state; None where that was before the start. As `due_s`.
        bundle: Whether it is a run bundle, of which the recorder keeps no state: that its copy was requested
            is known here alone.
    """

    recording_id: str
    label: str = ""
    priority: Priority = Priority.OTHER
    started_unix_ms: int = 0
    size: int = 0
    sha256: bytes = b""
    state: State = State.LOCAL
    reason: str = ""
    bytes_done: int = 0
    failures: int = 0
    cuts: int = 0
    due_s: float = 0.0
    since_s: float | None = None
    bundle: bool = False

    @property
    def order(self) -> tuple[Priority, int, str]:
        """What the queue is sorted by."""
        return self.priority, self.started_unix_ms, self.recording_id


class UploadStore(Protocol):
    """Keeps the queue over restarts and power failures: one row for each recording."""

    async def uploads(self) -> list[Upload]:
        """Returns all rows, without what is not kept over a restart.

        Raises:
            OSError: The disk can't be read.
        """

    async def put_upload(self, upload: Upload) -> None:
        """Writes a row, in place of one of the same recording; returns when it is on the disk.

        Raises:
            OSError: The disk can't be written.
        """

    async def delete_uploads(self, recording_ids: Sequence[str]) -> None:
        """Deletes rows, as far as they are there; where it fails, some may be left.

        Raises:
            OSError: The disk can't be written.
        """


def step(upload: Upload, event: Event, now_s: float, reason: str = "") -> Upload:
    """Returns the upload after an event.

    Args:
        upload: Before it.
        event: What happens.
        now_s: Monotonic seconds.
        reason: Why, for PAUSE, FAILURE and CUT.

    Raises:
        IllegalEventError: The state has no transition for this event.
    """
    state = TRANSITIONS[upload.state].get(event)
    if state is None:
        raise IllegalEventError(upload.state, event)
    changed = upload if state is upload.state else replace(upload, state=state, since_s=now_s)
    match event:
        case Event.FAILURE:
            changed = _failed(changed, reason, now_s)
        case Event.CUT:
            changed = replace(changed, reason=reason, cuts=upload.cuts + 1)
            if changed.cuts >= MOST_CUTS:
                changed = _failed(changed, reason, now_s)
        case Event.PAUSE:
            changed = replace(changed, reason=reason)
        case Event.CONFIRMED:
            changed = replace(changed, reason="", bytes_done=upload.size, failures=0, cuts=0, due_s=0.0)
        case _ if state is not upload.state:
            changed = replace(changed, reason="", due_s=0.0)
    return changed


def progressed(upload: Upload, bytes_done: int) -> Upload:
    """Returns the upload once the store has so many bytes."""
    done = min(bytes_done, upload.size)
    return replace(upload, bytes_done=done, cuts=0 if done > upload.bytes_done else upload.cuts)


def _failed(upload: Upload, reason: str, now_s: float) -> Upload:
    """Returns the upload after a failure of this recording."""
    failures = upload.failures + 1
    due_s = now_s + pause_s(failures, FIRST_PAUSE_S, LONGEST_PAUSE_S)
    return replace(upload, reason=reason, failures=failures, due_s=due_s)


def next_upload(uploads: Iterable[Upload], now_s: float, *, path_works: bool = True) -> Upload | None:
    """Returns the one to upload now; None where none waits, or those that do have just failed.

    Args:
        uploads: All of them.
        now_s: Monotonic seconds.
        path_works: Whether the last attempt was not cut. If it was, those that were cut again and again go
            last: what fails may be they.
    """
    due = (
        each
        for each in uploads
        if each.state in WAITING and (each.state is not State.FAILED or each.due_s <= now_s)
    )
    return min(due, key=lambda each: (not path_works and each.cuts >= MOST_CUTS, each.order), default=None)


def in_order(uploads: Iterable[Upload]) -> list[Upload]:
    """Returns those that run or wait, the one that runs first and then the most urgent."""
    waiting = (each for each in uploads if each.state in WAITING)
    return sorted(waiting, key=lambda each: (each.state not in RUNNING, each.order))


def last_to_run(uploads: Iterable[Upload]) -> Upload | None:
    """Returns the last in order of those that may lose their places; None if there is none.

    Those wait, do not run, and would be queued again: by the rule, or as the recorder knows that they were
    requested.
    """
    waiting = (
        each
        for each in uploads
        if each.state in WAITING - RUNNING and not (each.bundle and each.priority is Priority.BY_HAND)
    )
    return max(waiting, key=lambda each: each.order, default=None)
