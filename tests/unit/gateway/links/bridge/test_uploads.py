"""Requests of uploads: repeated ones change nothing, and the recorder knows at once."""

from typing import Any

import pytest

from common.errors import BridgeUnreachableError
from gateway.links.bridge.uploads import ANSWERED_S, MOST_ANSWERS, Uploads
from gateway.status.cloud import CopyReport, RecordingCopy, RecordingCopyState

State = RecordingCopyState


class Bridge:
    """Calls of the bridge, and the recorder's copies."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, str]] = []
        self.noted: list[tuple[str, State]] = []
        self.state = State.QUEUED
        self.error: Exception | None = None

    async def upload(self, recording_id: str, _caller: str, _remaining_s: float | None) -> RecordingCopy:
        return self._called("upload", recording_id)

    async def cancel(self, recording_id: str, _caller: str, _remaining_s: float | None) -> RecordingCopy:
        return self._called("cancel", recording_id)

    def note(self, report: CopyReport) -> None:
        self.noted.append((report.recording_id, report.copy.state))

    def _called(self, what: str, recording_id: str) -> RecordingCopy:
        if self.error:
            raise self.error
        self.calls.append((what, recording_id))
        return RecordingCopy(self.state)


class Ground:
    def __init__(self) -> None:
        self.now_s = 1000.0
        bridge: Any = Bridge()
        self.bridge = bridge
        self.uploads = Uploads(bridge, bridge, lambda: self.now_s)

    async def queue(self, request_id: str, recording_id: str = "a") -> RecordingCopy:
        return (await self.uploads.queue(request_id, recording_id, "anna", None)).copy

    async def cancel(self, request_id: str) -> RecordingCopy:
        return (await self.uploads.cancel(request_id, "a", "anna", None)).copy


async def test_a_repeated_request_gets_the_first_answer_for_ten_minutes() -> None:
    it = Ground()
    assert (await it.queue("1")).state is State.QUEUED
    await it.cancel("1")
    it.bridge.state = State.UPLOADING
    assert (await it.queue("1")).state is State.QUEUED
    assert it.bridge.calls == [("upload", "a"), ("cancel", "a")], "IDs are of one method"
    it.now_s += ANSWERED_S + 1
    assert (await it.queue("1")).state is State.UPLOADING


async def test_what_failed_is_tried_again() -> None:
    it = Ground()
    it.bridge.error = BridgeUnreachableError("gone")
    with pytest.raises(BridgeUnreachableError):
        await it.queue("1")
    it.bridge.error = None
    await it.queue("1")
    assert it.bridge.calls == [("upload", "a")]


async def test_answers_are_bounded() -> None:
    it = Ground()
    for number in range(MOST_ANSWERS + 1):
        await it.queue(str(number))
    await it.queue("1")
    assert len(it.bridge.calls) == MOST_ANSWERS + 1
    await it.queue("0")
    assert len(it.bridge.calls) == MOST_ANSWERS + 2


async def test_the_recorder_knows_at_once_and_keeps_what_is_verified() -> None:
    it = Ground()
    await it.queue("1")
    await it.cancel("2")
    it.bridge.state = State.VERIFIED
    await it.cancel("3")
    assert it.bridge.noted == [("a", State.QUEUED), ("a", State.UNSPECIFIED)]
    without = Uploads(it.bridge, None)
    await without.queue("1", "a", "anna", None)
