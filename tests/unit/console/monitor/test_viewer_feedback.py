"""When requests for key frames are sent, on a clock that the test plays."""

import asyncio

import pytest

from console.client import Clock, PictureReport, results
from console.monitor.viewer_feedback import ViewerFeedback
from tests.support.virtual_time import in_virtual_time

BURST = 3
REFILLED_S = 0.34


class Robot:
    """Notes when each request comes."""

    def __init__(self) -> None:
        self.clock = Clock()
        self.requests_s: list[float] = []

    async def request_key_frame(self, newest_pts: int | None = None) -> results.KeyFrameAnswer:
        assert newest_pts is not None
        self.requests_s.append(asyncio.get_running_loop().time())
        return results.KeyFrameAnswer(forced=True)

    async def report_picture(self, report: PictureReport) -> None:
        raise AssertionError(report)


@pytest.mark.parametrize("late_s", [0.0, 0.2, 0.3])
def test_a_request_after_the_burst_waits_for_its_turn_and_no_longer(
    late_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = Robot()

    @in_virtual_time
    async def play() -> None:
        loop = asyncio.get_running_loop()
        monkeypatch.setattr("console.monitor.viewer_feedback.time.monotonic", loop.time)
        feedback = ViewerFeedback(lambda: None)
        running = asyncio.create_task(feedback.run(robot))
        for pts in range(BURST):
            await asyncio.sleep(0)
            feedback.request_key_frame(pts)
            await asyncio.sleep(0.001)
        await asyncio.sleep(late_s)
        feedback.request_key_frame(BURST)
        await asyncio.sleep(1.0)
        running.cancel()

    play()
    assert robot.requests_s[BURST] == pytest.approx(REFILLED_S, abs=0.005)
    assert len(robot.requests_s) == BURST + 1
