"""What the bridge needs of the uploads, and a stand-in for a robot that uploads nothing."""

from collections.abc import Sequence
from typing import Protocol

from common.errors import NotFoundError, PreconditionError
from common.reasons import Reason
from omniseer.bridge.v1 import bridge_service_pb2 as bridge_pb
from omniseer.fleet.v1.upload_pb2 import UploadBrief
from omniseer.gateway.v1 import cloud_pb2
from omniseer.gateway.v1.recording_pb2 import RecordingCopy


class Uploading(Protocol):
    """The uploads, as status, reports and calls of the gateway see them."""

    def describe(self, status: cloud_pb2.CloudStatus) -> None:
        """Writes the fields about uploads into a status."""

    def briefs(self) -> Sequence[UploadBrief]:
        """Returns those that run or wait, in their order."""

    def copies(self) -> Sequence[bridge_pb.CopyReport]:
        """Returns the copies that the recorder is to know, at most 64; those that run or wait first."""

    async def enqueue(self, recording_id: str) -> RecordingCopy:
        """Queues a recording; raises a DomainError."""

    async def cancel(self, recording_id: str) -> RecordingCopy:
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

    async def enqueue(self, recording_id: str) -> RecordingCopy:
        """Refuses."""
        raise PreconditionError(
            f"{recording_id} can't be uploaded: hub.receipts does not name the enrolment's receipts.pub",
            Reason.RECORDING_NOT_CONFIGURED,
        )

    async def cancel(self, recording_id: str) -> RecordingCopy:
        """Refuses."""
        raise NotFoundError(f"{recording_id} is not queued for upload", Reason.RECORDING_NOT_FOUND)
