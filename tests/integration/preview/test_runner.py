"""The real pipeline passes the tests that its double passes."""

import asyncio
import socket
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from common.gst import Gst
from preview.config import AdaptiveSettings
from preview.pipeline.adaptive import BitrateController, Decision, Sample
from preview.pipeline.events import AccessUnit, PipelineEvents
from preview.pipeline.framing import Framing
from preview.pipeline.listener import Listener
from preview.pipeline.plan import Plan
from preview.pipeline.runner import Runner
from tests.support.eventually import eventually
from tests.support.pipeline_contract import LIVE, Events, PipelineContract, another, plan_of, writes_its_graph
from tests.support.recording import record
from tests.support.watcher import Watcher

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

    async def reported() -> list[float | None]:
        # Again and again, as viewers do: for 3 s after a frame that was late itself, none counts.
        runner.take_picture_age(140)
        return seen

    with Watcher(plan.srt.port):
        await eventually(windows, bool, "a window with a viewer")
        assert seen[0] is None
        await eventually(reported, lambda ages: ages[-1] == 140, "the age", 30.0)
    assert await (await runner.stop())


async def test_an_age_that_the_camera_causes_is_not_of_the_link() -> None:
    """A camera that delivers nothing for half a second, as a real pipeline shows it."""
    events = Events()
    runner = Runner(plan_of(LIVE), events)
    await runner.start()
    await events.wait_for("first_frame")
    age = runner._picture_age

    async def counts() -> int | None:
        runner.take_picture_age(140)
        return age.counting(time.monotonic())

    # Not at once: on a busy machine the first frames may be late themselves.
    await eventually(counts, lambda found: found == 140, "the age is the link's", 30.0)
    pad = runner._running.parts.source.get_static_pad("src")
    stalled = pad.add_probe(Gst.PadProbeType.BLOCK_DOWNSTREAM, lambda *_: Gst.PadProbeReturn.OK)
    await eventually(counts, lambda found: found is None, "the camera stands still", 2.0)
    pad.remove_probe(stalled)
    runner.take_picture_age(600)
    assert age.counting(time.monotonic()) is None
    assert await (await runner.stop())


async def test_the_age_of_the_newest_frame_can_be_read_at_every_moment() -> None:
    """The sink takes the first buffer of a frame and the list of all one after the other."""

    def read_until_the_first_frame(framing: Framing) -> None:
        deadline = time.monotonic() + 10.0
        while not framing.last_frame_age_ms:
            assert time.monotonic() < deadline

    for _ in range(5):
        runner = Runner(plan_of(LIVE), Events())
        reading = asyncio.create_task(asyncio.to_thread(read_until_the_first_frame, runner._framing))
        await runner.start()
        await reading
        assert await (await runner.stop())


async def test_a_recording_gets_every_encoded_frame() -> None:
    """The gate for viewers drops frames until a key frame, which the recording must not miss."""
    units, events = list[AccessUnit](), Events()
    runner = Runner(plan_of(f"{LIVE} num-buffers=150"), events)
    runner.record(units.append)
    encoded = list[int]()

    def count(_pad: Any, info: Any) -> Any:
        encoded.append(info.get_buffer().pts)
        return Gst.PadProbeReturn.OK

    # Before anything may drop a frame.
    runner._running.parts.encoder.get_static_pad("src").add_probe(Gst.PadProbeType.BUFFER, count)
    await runner.start()
    await events.wait_for("first_frame")
    viewer = asyncio.create_task(asyncio.to_thread(record, runner.plan.srt.port, 0.5))
    await events.wait_for("failed")
    assert await (await runner.stop())
    await viewer
    assert len(units) == len(encoded) > 10
    assert [unit.skipped for unit in units] == [0] * len(units)
    assert all(later.captured_ns > earlier.captured_ns for earlier, later in pairwise(units))


async def test_a_pipeline_that_may_do_without_its_listener_goes_on(tmp_path: Path) -> None:
    events = Events()
    events.goes_on = True
    runner = Runner(plan_of(LIVE), events)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", runner.plan.srt.port))
        await runner.start()
        assert "can't be used" in events.faults[0].text
        await events.wait_for("first_frame")
    await runner.listen("correct horse battery")
    assert events.counts["listener_failed"] == 1
    await writes_its_graph(runner, tmp_path / "graph.dot", "GstSRTSink")
    assert await (await runner.stop())


async def test_a_camera_that_becomes_live_while_the_listener_opens_stays_the_one_that_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As when an operator enables another camera than the one that a recording has running."""
    events, open_listener = Events(), Listener.start
    runner = Runner(replace(plan_of(LIVE), passphrase=None), events)
    await runner.start()
    await events.wait_for("first_frame")

    async def start(self: Listener, send_to: Callable[[int], None]) -> bool:
        await events.wait_for("camera_shown")
        return await open_listener(self, send_to)

    monkeypatch.setattr(Listener, "start", start)
    runner.show(another("rear"))
    await runner.listen("")
    assert (runner.live_camera, runner.plan.source.camera, runner.plan.passphrase) == ("rear", "rear", "")
    assert await (await runner.stop())


async def test_the_end_of_a_camera_that_is_replaced_is_not_taken_for_that_of_the_next() -> None:
    """Both are on their way to the event loop at once."""
    events = Events()
    runner = Runner(plan_of(LIVE), events)
    await runner.start()
    await events.wait_for("first_frame")
    end = runner._camera._source_end
    runner.show(another("rear"))
    await events.wait_for("camera_shown")
    # As if the old camera's thread had come as far as this just before it was replaced.
    assert end._probe(end._pad, SimpleNamespace(get_event=Gst.Event.new_eos)) == Gst.PadProbeReturn.DROP
    await events.wait_for("measured", events.counts["measured"] + 1)
    assert not events.faults
    assert events.counts["camera_failed"] == 0
    assert await (await runner.stop())
