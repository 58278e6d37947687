"""An error of srtsink while the preview runs, as a failed accept is one from GStreamer 1.24 on."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from common.gst import GLib, Gst
from preview.encoders.catalogue import CATALOGUE, Encoder
from preview.encoders.crash_marker import CrashMarkerFile
from preview.encoders.probe import TrialProber, Verdict
from preview.encoders.selection import Selection
from preview.pipeline import sources
from preview.pipeline.events import PipelineEvents
from preview.pipeline.plan import Plan
from preview.pipeline.runner import Runner
from preview.pipeline.sources import SourcePlan
from preview.state.lifecycle import State
from preview.state.values import ActualState, DesiredState, Profile
from preview.supervisor.supervisor import Supervisor
from tests.support.pipeline_contract import LIVE, plan_of
from tests.support.watcher import Watcher

pytestmark = pytest.mark.gst

PATIENCE_S = 30.0


async def test_a_failed_accept_costs_viewers_the_connection_and_not_the_encoder(tmp_path: Path) -> None:
    settings = plan_of(LIVE).settings.model_copy(update={"runtime_dir": tmp_path})
    runners = list[Runner]()

    def build(plan: Plan, events: PipelineEvents) -> Runner:
        runners.append(Runner(plan, events))
        return runners[-1]

    async def plan_camera(camera: str) -> SourcePlan:
        return sources.plan_camera(settings, camera)

    async def attempt(_encoder: Encoder) -> Verdict:
        return Verdict(present=True, proven=True)

    async def running_with(holds: Callable[[], bool] = lambda: True) -> ActualState:
        def is_so() -> bool:
            return supervisor.actual().state is State.RUNNING and holds()

        assert await supervisor.changes.wait_until(is_so, PATIENCE_S)
        return supervisor.actual()

    encoders = Selection([CATALOGUE["x264"]], 600, TrialProber(attempt))
    supervisor = Supervisor(settings, encoders, CrashMarkerFile(tmp_path), build, plan_camera)
    stop = asyncio.Event()
    serving = asyncio.create_task(supervisor.run(stop))
    with supervisor.watched():
        supervisor.apply(DesiredState(1, True, Profile.BALANCED))
        await running_with()
        with Watcher(settings.srt.port, max_age_s=10.0) as watcher:
            await asyncio.to_thread(watcher.wait_for_frames, 5)
            listener = runners[0]._listener
            assert listener
            post_failed_accept(listener.sink)
            state = await running_with(lambda: runners[0]._listener not in (None, listener))
            await asyncio.to_thread(watcher.wait_for_frames, 5)
        assert (state.counters.starts, state.counters.faults) == (1, 0)
        assert "the SRT listener on port" in state.last_error
    stop.set()
    await serving
    assert len(runners) == 1


def post_failed_accept(sink: Any) -> None:
    """Posts what srtsink of 1.24 posts when it can't accept a caller."""
    error = GLib.Error.new_literal(
        Gst.ResourceError.quark(), "Failed to accept a connection", Gst.ResourceError.FAILED
    )
    sink.post_message(Gst.Message.new_error(sink, error, "gstsrtobject.c: Connection setup failure"))
