"""Follows the copy of a recording to the fleet's store, which the robot makes by itself."""

from collections.abc import AsyncGenerator
from contextlib import aclosing
from dataclasses import dataclass
from typing import Final, Protocol

from console.client.errors import DeadlineExceeded, Unreachable
from console.client.results import (
    CloudState,
    CloudStatus,
    Recording,
    RecordingCopy,
    RecordingCopyState,
    WatchedStatus,
)
from console.client.streams import Outage

_EVERY_S: Final = 1.0
_UNSEEN: Final = 10
"""Statuses without a copy, after which it counts as cancelled: the recorder learns of it after the queue."""


@dataclass(frozen=True, slots=True)
class UploadProgress:
    """How far the copy of a recording is.

    Args:
        copy: Of the recording; its state is UNKNOWN when it is not to be copied any more.
        size: Of the recording, in bytes; 0 before it is known.
        bytes_per_s: Sent at present.
        waiting: Why nothing is sent at the moment, for people; else empty.
    """

    copy: RecordingCopy
    size: int = 0
    bytes_per_s: int = 0
    waiting: str = ""


class Robot(Protocol):
    """The part of a client that is used."""

    def watch_status(self, min_interval_s: float = 0.1) -> AsyncGenerator[WatchedStatus | Outage]:
        """Yields the status, and outages."""

    async def recording(self, recording_id: str) -> Recording:
        """Returns a recording."""


async def upload_progress(robot: Robot, recording_id: str) -> AsyncGenerator[UploadProgress]:
    """Yields the progress of a recording's copy, until that is verified or cancelled.

    Raises:
        GatewayError: The recording is deleted, or the robot refuses; not for an outage.
    """
    newest = UploadProgress(RecordingCopy(state=RecordingCopyState.UNKNOWN, reason="", bytes_done=0))
    unseen = 0
    async with aclosing(robot.watch_status(_EVERY_S)) as statuses:
        async for item in statuses:
            if isinstance(item, Outage):
                yield UploadProgress(newest.copy, newest.size, waiting="no connection to the robot")
                continue
            found = await _found(robot, recording_id)
            if found is None:
                continue
            newest = _progress(item.status.cloud, found)
            state = newest.copy.state
            unseen = unseen + 1 if state is RecordingCopyState.UNKNOWN else 0
            if 0 < unseen < _UNSEEN:
                continue
            yield newest
            if state in (RecordingCopyState.UNKNOWN, RecordingCopyState.VERIFIED):
                return


async def _found(robot: Robot, recording_id: str) -> Recording | None:
    """Returns the recording; None while the robot is not reached, which the stream of the status reports."""
    try:
        return await robot.recording(recording_id)
    except (Unreachable, DeadlineExceeded):
        return None


def _progress(cloud: CloudStatus | None, found: Recording) -> UploadProgress:
    if cloud is not None and cloud.uploading_id == found.id and cloud.uploading is not None:
        # Newer than what the recorder has of it.
        return UploadProgress(cloud.uploading, found.size, cloud.upload_bytes_per_s, cloud.uploads_paused)
    return UploadProgress(found.copy, found.size, 0, found.copy.reason or _why(cloud))


def _why(cloud: CloudStatus | None) -> str:
    """Returns why a recording that is not being copied waits."""
    if cloud is None or cloud.state is CloudState.CONNECTED:
        return cloud.uploads_paused if cloud else ""
    return cloud.last_error or f"the robot's connection to its fleet is {cloud.state.value}"
