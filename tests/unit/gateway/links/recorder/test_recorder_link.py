"""What the link keeps of the recorder's reports."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from gateway.links.recorder.link import RecorderLink
from gateway.links.watch import LinkLostError
from gateway.status.recording import RecorderReport, RecorderState
from tests.support.recorder_views import idle


class Recorder:
    """A recorder whose reports the test writes; None is a lost connection."""

    def __init__(self) -> None:
        self.queue: asyncio.Queue[RecorderReport | None] = asyncio.Queue()

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[Any]:
        yield self

    async def reports(self) -> AsyncIterator[RecorderReport]:
        while (report := await self.queue.get()) is not None:
            yield report
        raise LinkLostError("gone")


def reported(**more: Any) -> RecorderReport:
    values: dict[str, Any] = {"instance_id": "a", "status": idle()}
    return RecorderReport(**(values | more))


async def test_a_loss_is_dated_and_a_new_process_counts_from_its_own_begin() -> None:
    recorder, now = Recorder(), [100.0]
    link = RecorderLink("recorder", recorder, lambda: now[0])
    assert (link.view.reachable, link.view.status.state) == (False, RecorderState.UNREACHABLE)
    running = asyncio.create_task(link.run())
    steps: list[tuple[RecorderReport, float | None]] = [
        (reported(messages_lost=5), None),
        (reported(messages_lost=5), None),
        (reported(messages_lost=6), 103.0),
        (reported(messages_lost=6, messages_dropped=1), 104.0),
        (reported(messages_lost=6, messages_dropped=1, uncounted_gaps=1), 105.0),
        (reported(instance_id="b", messages_lost=9), 105.0),
        (reported(instance_id="b", messages_lost=10), 107.0),
    ]
    for number, (report, lost_s) in enumerate(steps, start=1):
        now[0] = 100.0 + number
        recorder.queue.put_nowait(report)

        def arrived(expected: RecorderReport = report) -> bool:
            return link.view.report is not None and link.view.report.value is expected

        assert await link.changes.wait_until(arrived, 5)
        assert link.view.lost_s == lost_s
    recorder.queue.put_nowait(None)
    assert await link.changes.wait_until(lambda: bool(link.view.error), 5)
    assert (link.view.error, link.view.lost_s) == ("gone", 107.0)
    assert link.view.report, "what it reported last is kept"
    recorder.queue.put_nowait(reported())
    assert await link.changes.wait_until(lambda: link.view.reachable, 5)
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
