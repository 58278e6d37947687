"""What the recorder is sent of copies, and when."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from common.errors import DefectError, NotFoundError, RecorderUnreachableError
from common.reasons import Reason
from gateway.links.bridge.copies import HOLDS_S, MOST_WAITING, PROGRESS_EVERY_S, Copies
from gateway.status.cloud import CloudView, CopyReport, RecordingCopyState
from gateway.status.recording import RecorderView
from tests.support.cloud_views import NEVER, connected, copy_of, view
from tests.support.recorder_views import idle
from tests.support.recorder_views import view as recorder_view

State = RecordingCopyState


class Recorder:
    """A recorder that can be away, or fail at one recording."""

    def __init__(self) -> None:
        self.sent: list[tuple[str, State, int]] = []
        self.error: Exception | None = None
        self.bad: dict[str, Exception] = {}
        self.tried = asyncio.Event()

    async def set_copy(self, report: CopyReport) -> None:
        self.tried.set()
        if error := self.error or self.bad.get(report.recording_id):
            raise error
        self.sent.append((report.recording_id, report.copy.state, report.copy.bytes_done))

    def taken(self) -> list[tuple[str, State, int]]:
        """What was sent since the last look."""
        taken, self.sent = self.sent, []
        return taken


class Ground:
    """Copies with a clock of their own, and a recorder."""

    def __init__(self) -> None:
        self.now_s = 1000.0
        recorder: Any = Recorder()
        self.recorder = recorder
        self.copies = Copies(recorder, lambda: self.now_s)

    async def take(
        self, *copies: CopyReport, bridge: str = "a", recorder: RecorderView | None = None
    ) -> list[tuple[str, State, int]]:
        seen = view(connected(), self.now_s, instance_id=bridge, copies=copies)
        self.copies.take(seen, recorder or recorder_view(idle(), self.now_s))
        await turns()
        return list(self.recorder.taken())


@asynccontextmanager
async def ground() -> AsyncIterator[Ground]:
    made = Ground()
    running = asyncio.create_task(made.copies.run())
    yield made
    running.cancel()


async def turns() -> None:
    for _ in range(300):
        await asyncio.sleep(0)


def queued(recording_id: str = "one") -> CopyReport:
    return copy_of(recording_id, State.QUEUED)


async def test_each_change_is_sent_once() -> None:
    async with ground() as it:
        assert await it.take(queued()) == [("one", State.QUEUED, 0)]
        assert await it.take(queued()) == []
        assert await it.take(queued(), queued("two")) == [("two", State.QUEUED, 0)]
        assert await it.take(copy_of("one", State.VERIFIED)) == [("one", State.VERIFIED, 0)]
        assert await it.take() == [], "what is not reported any more stays as it was"


async def test_progress_alone_is_sent_now_and_then() -> None:
    async with ground() as it:
        sent = []
        for second in range(12):
            done = 1000 * second
            sent += [done for _, _, done in await it.take(copy_of("one", State.UPLOADING, bytes_done=done))]
            it.now_s += 1
        assert sent == [0, 1000 * int(PROGRESS_EVERY_S), 2000 * int(PROGRESS_EVERY_S)]
        paused = copy_of("one", State.PAUSED, bytes_done=11_000)
        assert await it.take(paused) == [("one", State.PAUSED, 11_000)]


async def test_all_is_sent_again_after_either_one_restarted() -> None:
    async with ground() as it:
        both = (queued(), queued("two"))
        assert len(await it.take(*both)) == 2
        assert len(await it.take(*both, bridge="b")) == 2
        other = recorder_view(idle(), it.now_s)
        assert other.report
        restarted = RecorderView(
            "", type(other.report)(type(other.report.value)("another process", idle()), it.now_s)
        )
        assert len(await it.take(*both, bridge="b", recorder=restarted)) == 2
        assert await it.take(*both, bridge="b", recorder=restarted) == []


async def test_while_either_one_is_away_nothing_is_concluded() -> None:
    async with ground() as it:
        lost = CloudView("gone", 0.0, view(connected(), it.now_s, copies=(queued(),)).report)
        for cloud in (NEVER, lost):
            it.copies.take(cloud, recorder_view(idle(), it.now_s))
        it.copies.take(view(connected(), it.now_s, copies=(queued(),)), RecorderView("gone"))
        it.copies.take(view(connected(), it.now_s, copies=(queued(),)), None)
        await turns()
        assert it.recorder.taken() == []


async def test_a_recorder_that_is_away_gets_the_newest_state_later() -> None:
    async with ground() as it:
        it.recorder.error = RecorderUnreachableError("gone")
        assert await it.take(queued(), queued("two")) == []
        assert await it.take(copy_of("one", State.FAILED, reason="no"), queued("two")) == []
        assert (it.copies.waiting, it.copies.failures) == (2, 1)
        it.recorder.error = None
        it.recorder.tried.clear()
        await asyncio.wait_for(it.recorder.tried.wait(), 5)
        await turns()
        assert sorted(it.recorder.taken()) == [("one", State.FAILED, 0), ("two", State.QUEUED, 0)]
        assert it.copies.waiting == 0


async def test_one_that_was_deleted_is_dropped_and_one_that_fails_holds_up_no_other() -> None:
    async with ground() as it:
        it.recorder.bad["gone"] = NotFoundError("no such recording", Reason.RECORDING_NOT_FOUND)
        assert await it.take(queued("gone"), queued("one")) == [("one", State.QUEUED, 0)]
        assert await it.take(queued("gone")) == []
        assert it.copies.waiting == 0
        it.recorder.bad["bad"] = DefectError("it failed")
        it.recorder.tried.clear()
        await it.take(queued("bad"), queued("two"))
        assert it.copies.waiting == 2, "it waits for a moment"
        it.recorder.tried.clear()
        await asyncio.wait_for(it.recorder.tried.wait(), 5)
        await turns()
        assert it.recorder.taken() == [("two", State.QUEUED, 0)]
        assert it.copies.waiting == 1


async def test_what_waits_is_bounded() -> None:
    async with ground() as it:
        it.recorder.error = RecorderUnreachableError("gone")
        for number in range(10_000):
            it.copies.note(queued(str(number)))
        assert (it.copies.waiting, it.copies.dropped) == (MOST_WAITING, 10_000 - MOST_WAITING)


async def test_an_older_report_does_not_undo_what_a_call_has_done() -> None:
    async with ground() as it:
        assert await it.take(queued()) == [("one", State.QUEUED, 0)]
        it.copies.note(copy_of("one", State.UNSPECIFIED))
        await turns()
        assert it.recorder.taken() == [("one", State.UNSPECIFIED, 0)]
        assert await it.take(queued()) == [], "this was on its way before the call"
        it.now_s += HOLDS_S
        assert await it.take(queued()) == [("one", State.QUEUED, 0)]
