"""Planning cameras: the loop goes on while a look hangs, which is an error that says what to do."""

import asyncio
import threading
from collections.abc import Iterator

import pytest

from common.errors import UserError
from preview.camera_planner import CameraPlanner
from preview.config import PreviewSettings, TestSource, TimeoutSettings
from preview.pipeline import sources
from preview.pipeline.sources import SourcePlan


@pytest.fixture
def answers(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """A look at the camera "share" returns once it is set."""
    answers, plan_camera = threading.Event(), sources.plan_camera

    def look(settings: PreviewSettings, camera: str) -> SourcePlan:
        if camera == "share":
            answers.wait(10)
        return plan_camera(settings, camera)

    monkeypatch.setattr(sources, "plan_camera", look)
    yield answers
    answers.set()


def planner(start_s: float = 5.0) -> CameraPlanner:
    cameras = {"share": TestSource(), "front": TestSource(pattern="ball")}
    return CameraPlanner(PreviewSettings(cameras={**cameras}, timeouts=TimeoutSettings(start_s=start_s)))


async def test_the_loop_goes_on_while_a_camera_is_looked_at(answers: threading.Event) -> None:
    plan = planner().plan
    share = asyncio.create_task(plan("share"))
    assert (await plan("front")).camera == "front"
    assert not share.done()
    answers.set()
    assert (await share).camera == "share"


async def test_a_look_that_hangs_is_an_error_and_one_thread(answers: threading.Event) -> None:
    plan = planner(start_s=0.02).plan
    before = threading.active_count()
    for _ in range(5):
        with pytest.raises(UserError, match=r"camera share does not answer: .* 0\.02 s\. If its file is"):
            await plan("share")
    assert threading.active_count() <= before + 1
    answers.set()


async def test_a_defect_is_an_error_of_the_camera(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def look(_settings: PreviewSettings, _camera: str) -> SourcePlan:
        raise ValueError("embedded null byte")

    monkeypatch.setattr(sources, "plan_camera", look)
    with pytest.raises(UserError, match="camera front can't be used: embedded null byte"):
        await planner().plan("front")
    assert "Traceback" in caplog.text
