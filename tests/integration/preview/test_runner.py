"""The real pipeline passes the tests that its double passes."""

import asyncio
from dataclasses import replace

import pytest

from preview.config import AdaptiveSettings
from preview.pipeline.adaptive import BitrateController, Decision, Sample
from preview.pipeline.events import PipelineEvents
from preview.pipeline.plan import Plan
from preview.pipeline.runner import Runner
from tests.support.eventually import eventually
from tests.support.pipeline_contract import LIVE, Events, PipelineContract, plan_of
from tests.support.recording import record

pytestmark = pytest.mark.gst


class TestRunner(PipelineContract):
    def build(self, plan: Plan, events: PipelineEvents) -> Runner:
        return Runner(plan, events)


async def test_the_age_that_viewers_report_reaches_the_adaptive_bit_rate(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[float | None] = []

    def decide(self: BitrateController, sample: Sample, now: float) -> Decision:
        seen.extend([sample.age_ms] if sample.viewers else [])
        return original(self, sample, now)

    original = BitrateController.decide
    monkeypatch.setattr(BitrateController, "decide", decide)
    plan = plan_of(LIVE)
    settings = plan.settings.model_copy(update={"adaptive": AdaptiveSettings(enabled=True)})
    plan, events = replace(plan, settings=settings), Events()
    runner = Runner(plan, events)
    await runner.start()
    await events.wait_for("first_frame")

    async def windows() -> list[float | None]:
        return seen

    viewer = asyncio.create_task(asyncio.to_thread(record, plan.srt.port, 2.5))
    await eventually(windows, bool, "a window with a viewer")
    runner.take_picture_age(140)
    await eventually(windows, lambda ages: ages[-1] == 140, "the age")
    assert seen[0] is None
    await viewer
    assert await (await runner.stop())
