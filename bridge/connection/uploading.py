"""The uploads as the rest of the bridge sees them, and a stand-in for a robot that uploads nothing."""

import asyncio
import logging
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, Protocol

from bridge.robot.calls import GatewayCalls
from bridge.uploads.queue import RUNNING, State, Upload
from common.errors import DomainError, NotFoundError, PreconditionError, RecorderUnreachableError
from common.jittered_backoff import JitteredBackoff
from common.reasons import Reason
from console.client import GatewayError
from omniseer.bridge.v1 import bridge_service_pb2 as bridge_pb
from omniseer.fleet.v1.upload_pb2 import UploadBrief
from omniseer.gateway.v1 import cloud_pb2
from omniseer.gateway.v1 import recording_pb2 as recording_pb

if TYPE_CHECKING:
    from bridge.uploads.uploads import Uploads

_log = logging.getLogger(__name__)

MOST_COPIES: Final = 64
"""Reported to the gateway."""
_MOST_PRESENT: Final = 16
"""Of these, those that run or have failed; they are in every report."""
_LOOK_S: Final = 30.0
"""How often the robot's recordings are looked at."""
_PAGE: Final = 200
_MOST_PAGES: Final = 50
STATES: Final = {
    State.LOCAL: recording_pb.RECORDING_COPY_STATE_UNSPECIFIED,
    State.QUEUED: recording_pb.RECORDING_COPY_STATE_QUEUED,
    State.UPLOADING: recording_pb.RECORDING_COPY_STATE_UPLOADING,
    State.VERIFYING: recording_pb.RECORDING_COPY_STATE_VERIFYING,
    State.VERIFIED: recording_pb.RECORDING_COPY_STATE_VERIFIED,
    State.PAUSED: recording_pb.RECORDING_COPY_STATE_PAUSED,
    State.FAILED: recording_pb.RECORDING_COPY_STATE_FAILED,
}
_PRESENT: Final = RUNNING | {State.FAILED}


class Uploading(Protocol):
    """The uploads, as status, reports and calls of the gateway see them."""

    def describe(self, status: cloud_pb2.CloudStatus) -> None:
        """Writes the fields about uploads into a status."""

    def briefs(self) -> Sequence[UploadBrief]:
        """Returns those that run or wait, in their order."""

    def copies(self) -> Sequence[bridge_pb.CopyReport]:
        """Returns the copies that the recorder is to know; those that run or have failed first."""

    async def enqueue(self, recording_id: str) -> recording_pb.RecordingCopy:
        """Queues a recording; raises a DomainError."""

    async def cancel(self, recording_id: str) -> recording_pb.RecordingCopy:
        """Takes a recording from the queue; raises a DomainError."""


class NoUploads:
    """Uploads of a robot without receivers' keys: none."""

    def describe(self, status: cloud_pb2.CloudStatus) -> None:
        """Leaves the status as it is."""

    def briefs(self) -> Sequence[UploadBrief]:
        """Returns none."""
        return ()

    def copies(self) -> Sequence[bridge_pb.CopyReport]:
        """Returns none."""
        return ()

    async def enqueue(self, recording_id: str) -> recording_pb.RecordingCopy:
        """Refuses."""
        raise PreconditionError(
            f"{recording_id} can't be uploaded: hub.receipts does not name the enrolment's receipts.pub",
            Reason.RECORDING_NOT_CONFIGURED,
        )

    async def cancel(self, recording_id: str) -> recording_pb.RecordingCopy:
        """Refuses."""
        raise NotFoundError(f"{recording_id} is not queued for upload", Reason.RECORDING_NOT_FOUND)


class QueuedUploads:
    """Uploads from the queue.

    Args:
        uploads: the queue and what works on it.
    """

    def __init__(self, uploads: "Uploads") -> None:
        self._uploads = uploads

    def describe(self, status: cloud_pb2.CloudStatus) -> None:
        """Writes the fields about uploads into a status."""
        uploads = self._uploads
        status.uploads_waiting = len(uploads.queue.waiting)
        status.uploads_left_out = uploads.queue.left_out.count
        status.uploads_paused = uploads.queue.disk_error or uploads.paused
        if current := uploads.current:
            status.uploading_id = current.recording_id
            status.uploading.CopyFrom(_copy(current))
            status.uploading_size = current.size
            status.upload_bytes_per_s = uploads.bytes_per_s

    def briefs(self) -> Sequence[UploadBrief]:
        """Returns those that run or wait, in their order."""
        current = self._uploads.current
        return [
            UploadBrief(
                recording_id=each.recording_id,
                label=each.label,
                copy=_copy(each),
                size=each.size,
                bytes_per_s=self._uploads.bytes_per_s if each is current else 0,
            )
            for each in self._uploads.queue.waiting
        ]

    def copies(self) -> Sequence[bridge_pb.CopyReport]:
        """Returns the copies that the recorder is to know: over some reports, all that it may not have."""
        queue = self._uploads.queue
        waiting = queue.waiting
        present = [each for each in waiting if each.state in _PRESENT][:_MOST_PRESENT]
        turn = map(queue.get, queue.unconfirmed.next(MOST_COPIES - len(present)))
        chosen = {each.recording_id: each for each in (*present, *turn) if each}
        for each in (*waiting, *queue.settled):
            if len(chosen) == MOST_COPIES:
                break
            chosen.setdefault(each.recording_id, each)
        now_s = asyncio.get_running_loop().time()
        return [
            bridge_pb.CopyReport(
                recording_id=each.recording_id, copy=_copy(each), state_age_ms=_state_age_ms(each, now_s)
            )
            for each in chosen.values()
        ]

    async def enqueue(self, recording_id: str) -> recording_pb.RecordingCopy:
        """Queues a recording; raises a DomainError."""
        try:
            return _copy(await self._uploads.enqueue(recording_id))
        except GatewayError as error:
            raise _no_answer(error) from error

    async def cancel(self, recording_id: str) -> recording_pb.RecordingCopy:
        """Takes a recording from the queue; raises a DomainError."""
        try:
            return _copy(await self._uploads.cancel(recording_id))
        except GatewayError as error:
            raise _no_answer(error) from error


async def apply_rule(uploads: "Uploads", gateway: GatewayCalls) -> None:
    """Makes the uploads look at the robot's recordings every 30 s, until cancelled."""
    backoff = JitteredBackoff()
    while True:
        try:
            token = ""
            uploads.queue.begin_listing()
            for _ in range(_MOST_PAGES):
                page = await gateway.list_recordings(_PAGE, token)
                await uploads.consider(page.recordings)
                if not (token := page.next_page_token):
                    uploads.queue.end_listing()
                    break
        except GatewayError as error:
            _log.info("the robot's recordings can't be listed: %s", error)
            await backoff.wait()
        else:
            backoff.reset()
            await asyncio.sleep(_LOOK_S)


def _copy(upload: Upload) -> recording_pb.RecordingCopy:
    return recording_pb.RecordingCopy(
        state=STATES[upload.state], reason=upload.reason, bytes_done=upload.bytes_done
    )


def _state_age_ms(upload: Upload, now_s: float) -> int | None:
    return None if upload.since_s is None else round((now_s - upload.since_s) * 1000)


def _no_answer(error: GatewayError) -> DomainError:
    return RecorderUnreachableError(f"the recording can't be looked up: {error}")
