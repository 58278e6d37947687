"""The calls that the bridge answers."""

from typing import Final

from common.errors import NotFoundError
from common.reasons import Reason
from gateway.links.bridge.refusals import REFUSALS
from gateway.links.bridge.requests import Answer
from gateway.links.bridge.wire import BridgeClient
from gateway.links.grpc_client import call_metadata
from gateway.links.watch import SharingConnector
from gateway.status.cloud import RecordingCopy

_ANSWER_WITHIN_S: Final = 5.0


class BridgeCalls(SharingConnector[BridgeClient]):
    """A connector for the link that uses its connection for calls as well. All raise a DomainError.

    `caller` is for people; `remaining_s` is until the caller's deadline, None without one.
    """

    async def upload(self, recording_id: str, caller: str, remaining_s: float | None) -> RecordingCopy:
        """Puts a recording into the queue of uploads; returns where its copy stands."""
        with REFUSALS.calling(self._client) as bridge:
            return await bridge.upload(recording_id, _within(remaining_s), call_metadata(caller))

    async def cancel(self, recording_id: str, caller: str, remaining_s: float | None) -> RecordingCopy:
        """Takes a recording from the queue; returns where its copy stood."""
        try:
            with REFUSALS.calling(self._client) as bridge:
                return await bridge.cancel(recording_id, _within(remaining_s), call_metadata(caller))
        except NotFoundError as error:
            raise NotFoundError(str(error), Reason.UPLOAD_NOT_QUEUED) from None

    async def answer(self, request_id: str, answer: Answer) -> None:
        """Answers a request of the hub."""
        with REFUSALS.calling(self._client) as bridge:
            await bridge.answer(request_id, answer, _ANSWER_WITHIN_S)


def _within(remaining_s: float | None) -> float:
    return _ANSWER_WITHIN_S if remaining_s is None else min(_ANSWER_WITHIN_S, remaining_s)
