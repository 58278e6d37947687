"""What the supervisor expects of a pipeline, as tests for the real one and for its double."""

import asyncio
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from common.errors import UserError
from preview.config import (
    GstSource,
    PreviewSettings,
    ProfileSettings,
    ProfilesSettings,
    SrtSettings,
    TimeoutSettings,
)
from preview.encoders.catalogue import CATALOGUE
from preview.pipeline import sources
from preview.pipeline.events import AccessUnit, Blame, Fault, PipelineEvents
from preview.pipeline.plan import Plan, make_plan
from preview.pipeline.sources import SourcePlan
from preview.state.values import DesiredState, EncoderChoice, Profile, Target
from preview.supervisor.ports import Pipeline
from tests.support.eventually import eventually
from tests.support.free import free_udp_port

LIVE = "videotestsrc is-live=true"
FASTER = Target(320, 240, 60, 900, 200)


class Events:
    """Counts events and keeps the faults."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.goes_on = False
        """Whether a pipeline goes on without its listener, or its camera."""
        self.cameras: list[str] = []
        """Those that became live, or failed."""
        self.faults: list[Fault] = []
        self._changed = asyncio.Event()

    def first_frame(self) -> None:
        self._count("first_frame")

    def failed(self, fault: Fault) -> None:
        self.faults.append(fault)
        self._count("failed")

    def listener_failed(self, fault: Fault) -> bool:
        self.faults.append(fault)
        self._count("listener_failed")
        return self.goes_on

    def camera_shown(self, camera: str) -> None:
        self.cameras.append(camera)
        self._count("camera_shown")

    def camera_failed(self, camera: str, fault: Fault) -> bool:
        self.cameras.append(camera)
        if self.goes_on:
            self.faults.append(fault)
        self._count("camera_failed")
        return self.goes_on

    def measured(self, viewers_refused: int) -> None:
        assert viewers_refused == 0
        self._count("measured")

    async def wait_for(self, name: str, count: int = 1) -> None:
        """Waits until an event has come `count` times."""
        async with asyncio.timeout(20):
            while self.counts[name] < count:
                self._changed.clear()
                await self._changed.wait()

    def _count(self, name: str) -> None:
        self.counts[name] += 1
        self._changed.set()


def plan_of(description: str, passphrase: str = "", start_s: float = 20.0) -> Plan:
    """A small stream of x264, with time enough for every frame on a machine that stalls."""
    small = ProfileSettings(width_px=320, height_px=240, bitrate_kbps=600, floor_kbps=150)
    faster = ProfileSettings(**asdict(FASTER))
    settings = PreviewSettings(
        source=GstSource(description=description),
        profiles=ProfilesSettings.model_validate({"balanced": small, "high-quality": faster}),
        srt=SrtSettings(bind="127.0.0.1", port=free_udp_port(), latency_ms=20),
        timeouts=TimeoutSettings(start_s=start_s, source_silence_s=10.0, encoder_silence_s=10.0),
    )
    desired = DesiredState(1, True, Profile.BALANCED, passphrase)
    source = sources.plan_camera(settings, "camera")
    return make_plan(settings, desired, CATALOGUE["x264"], EncoderChoice("x264", False, "x264"), source)


def another(name: str, description: str = f"{LIVE} pattern=ball") -> SourcePlan:
    """A camera beside the one of the plan."""
    return SourcePlan(name, f"camera {name}", description, "Check its cable")


def cameras_of(pipeline: Pipeline) -> tuple[str | None, str | None]:
    """The live one, and the one that is being started."""
    return pipeline.live_camera, pipeline.starting_camera


async def writes_its_graph(pipeline: Pipeline, path: Path, element: str = "") -> None:
    """Has a pipeline write its graph, with this element; again where a stall has made it give up."""

    def text() -> str:
        return path.read_text(encoding="utf-8") if path.exists() else ""

    async def written() -> str:
        await pipeline.write_graph(path)
        return text()

    await eventually(written, lambda found: found.startswith("digraph") and element in found, "the graph")


class PipelineContract:
    """A subclass provides `build`."""

    build: Callable[[Plan, PipelineEvents], Pipeline]

    async def test_it_reports_one_first_frame_and_then_statistics(self) -> None:
        events = Events()
        pipeline = self.build(plan_of(LIVE, "correct horse battery"), events)
        before = pipeline.measurement
        assert before is None
        assert not events.counts
        await pipeline.start()
        await events.wait_for("measured", 2)
        assert events.counts["first_frame"] == 1
        assert pipeline.measurement is not None
        assert pipeline.measurement.fps > 0
        stream = pipeline.stream
        assert (stream.target.width_px, stream.bitrate_kbps, stream.bitrate_reason) == (320, 600, "")
        assert stream.encrypted
        assert await (await pipeline.stop())
        assert not events.faults

    async def test_another_profile_changes_the_running_pipeline(self) -> None:
        events = Events()
        pipeline = self.build(plan_of(LIVE), events)
        await pipeline.start()
        await events.wait_for("first_frame")
        await pipeline.switch(Profile.HIGH_QUALITY)
        assert pipeline.plan.profile is Profile.HIGH_QUALITY
        assert (pipeline.stream.target, pipeline.stream.bitrate_kbps) == (FASTER, 900)
        await events.wait_for("measured", events.counts["measured"] + 2)
        assert await (await pipeline.stop())
        assert events.counts["first_frame"] == 1
        assert not events.faults

    async def test_a_listener_comes_and_goes_while_it_runs(self) -> None:
        events = Events()
        pipeline = self.build(replace(plan_of(LIVE), passphrase=None), events)
        await pipeline.start()
        await events.wait_for("first_frame")
        for passphrase in ("correct horse battery", "", None):
            await pipeline.listen(passphrase)
            assert pipeline.plan.passphrase == passphrase
            assert pipeline.stream.encrypted is bool(passphrase)
        await events.wait_for("measured", events.counts["measured"] + 2)
        assert await (await pipeline.stop())
        assert events.counts["first_frame"] == 1
        assert not events.faults

    async def test_another_camera_takes_the_place_of_the_live_one(self) -> None:
        events = Events()
        pipeline = self.build(plan_of(LIVE), events)
        await pipeline.start()
        await events.wait_for("first_frame")
        assert cameras_of(pipeline) == ("camera", None)
        for number, name in enumerate(("rear", "arm"), 1):
            live = pipeline.live_camera
            pipeline.show(another(name))
            assert cameras_of(pipeline) == (live, name)
            await events.wait_for("camera_shown", number)
            assert cameras_of(pipeline) == (name, None)
        assert pipeline.plan.source.camera == "arm"
        await events.wait_for("measured", events.counts["measured"] + 2)
        assert pipeline.measurement is not None
        assert pipeline.measurement.fps > 0
        assert await (await pipeline.stop())
        assert events.counts["first_frame"] == 1
        assert not events.faults

    async def test_of_two_cameras_the_newest_counts_and_none_may_be(self) -> None:
        events = Events()
        pipeline = self.build(plan_of(LIVE), events)
        await pipeline.start()
        await events.wait_for("first_frame")
        pipeline.show(another("rear"))
        pipeline.show(another("arm"))
        await events.wait_for("camera_shown")
        pipeline.show(another("rear"))
        pipeline.show(None)
        assert cameras_of(pipeline) == ("arm", None)
        await events.wait_for("measured", events.counts["measured"] + 2)
        assert await (await pipeline.stop())
        assert events.cameras == ["arm"]

    async def test_a_camera_that_is_being_started_may_be_stopped_with_the_pipeline(self) -> None:
        events = Events()
        pipeline = self.build(plan_of(LIVE), events)
        await pipeline.start()
        await events.wait_for("first_frame")
        pipeline.show(another("rear"))
        assert await (await pipeline.stop())
        assert not events.cameras

    async def test_without_a_live_camera_and_another_one_the_pipeline_fails(self) -> None:
        events = Events()
        events.goes_on = True
        pipeline = self.build(plan_of(f"{LIVE} num-buffers=15"), events)
        await pipeline.start()
        await events.wait_for("camera_failed")
        assert cameras_of(pipeline) == (None, None)
        assert not events.counts["failed"]
        pipeline.show(None)
        await events.wait_for("failed")
        assert await (await pipeline.stop())
        lost, failed = events.faults
        assert failed is lost

    async def test_a_recording_gets_its_access_units_from_then_on(self) -> None:
        events, units = Events(), list[AccessUnit]()
        pipeline = self.build(plan_of(LIVE), events)
        pipeline.record(units.append)
        await pipeline.start()
        await events.wait_for("measured", 2)
        assert units
        assert units[0].key_frame
        pipeline.record(None)
        count = len(units)
        await events.wait_for("measured", events.counts["measured"] + 2)
        assert await (await pipeline.stop())
        assert len(units) == count

    async def test_a_source_that_ends_is_one_fault_and_the_last_event(self, tmp_path: Path) -> None:
        events = Events()
        pipeline = self.build(plan_of(f"{LIVE} num-buffers=5"), events)
        await pipeline.start()
        await events.wait_for("failed")
        counts = dict(events.counts)
        assert [fault.blame for fault in events.faults] == [Blame.SOURCE]
        assert "has ended" in events.faults[0].text
        await writes_its_graph(pipeline, tmp_path / "new" / "graph.dot")
        assert await (await pipeline.stop())
        assert events.counts == counts

    async def test_a_recording_that_comes_while_it_is_stopped_gets_nothing(self) -> None:
        units = list[AccessUnit]()
        pipeline = self.build(plan_of(LIVE), Events())
        await pipeline.start()
        stopped = await pipeline.stop()
        pipeline.record(units.append)
        assert await stopped
        pipeline.record(None)
        assert not units

    async def test_nothing_is_reported_once_it_is_being_stopped(self) -> None:
        events = Events()
        pipeline = self.build(plan_of(LIVE), events)
        await pipeline.start()
        stopping = asyncio.create_task(pipeline.stop())
        await asyncio.sleep(0)
        counts = dict(events.counts)
        assert await (await stopping)
        assert events.counts == counts

    async def test_what_can_not_be_built_is_an_error_for_people(self) -> None:
        with pytest.raises(UserError, match="nonsense"):
            self.build(plan_of("nonsense is-live=true"), Events())
