"""A service reports so often that the gateway keeps it when two reports in a row come late."""

import asyncio
import inspect
from collections.abc import AsyncIterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from bridge.rpc.servicer import BridgeServicer
from common.broadcast import HEARTBEAT_S, Broadcast
from gateway.links.bridge.link import BridgeLink
from gateway.links.watch import ServiceWatch
from omniseer.bridge.v1 import bridge_service_pb2 as bridge_pb
from omniseer.preview.v1 import preview_service_pb2 as preview_pb
from omniseer.recorder.v1 import recorder_service_pb2 as recorder_pb
from preview.camera_planner import CameraPlanner
from preview.config import PreviewSettings, TestSource
from preview.encoders.catalogue import Encoder
from preview.encoders.crash_marker import CrashMarkerFile
from preview.encoders.probe import TrialProber, Verdict
from preview.encoders.selection import Selection
from preview.rpc.servicer import PreviewServicer
from preview.supervisor.supervisor import Supervisor
from recorder.rpc import mapping
from recorder.rpc.servicer import RecorderServicer
from tests.support.pipeline_double import PipelineDoubles
from tests.support.virtual_time import in_virtual_time

LATE_REPORTS = 2
SILENCE_S = float(inspect.signature(ServiceWatch.__init__).parameters["silence_s"].default)
NO_CONTEXT = cast("Any", None)


async def longest_gap_s(reports: AsyncIterator[object]) -> float:
    """Seconds of the loop's clock between reports in which nothing changes."""
    loop, gaps = asyncio.get_running_loop(), []
    await anext(reports)
    for _ in range(5):
        before_s = loop.time()
        await anext(reports)
        gaps.append(loop.time() - before_s)
    return max(gaps)


async def no_trial(_encoder: Encoder) -> Verdict:
    return Verdict(present=False, proven=False)


def test_an_idle_preview(tmp_path: Path) -> None:
    @in_virtual_time
    async def check() -> None:
        prober = TrialProber(no_trial)
        selection = Selection([], 600, prober)
        settings = PreviewSettings(source=TestSource(), runtime_dir=tmp_path)
        plan = CameraPlanner(settings).plan
        supervisor = Supervisor(settings, selection, CrashMarkerFile(tmp_path), PipelineDoubles(), plan)
        servicer = PreviewServicer(supervisor, prober, ())
        reports = servicer.WatchActualState(preview_pb.WatchActualStateRequest(), NO_CONTEXT)
        assert await longest_gap_s(reports) * LATE_REPORTS < SILENCE_S

    check()


def test_an_idle_recorder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mapping, "watch_state", lambda *_: recorder_pb.WatchStateResponse())

    @in_virtual_time
    async def check() -> None:
        servicer = RecorderServicer.__new__(RecorderServicer)
        servicer._status_reader = cast("Any", SimpleNamespace(changes=Broadcast(), writes=False))
        servicer._settings = servicer._messages = cast("Any", None)
        reports = servicer.WatchState(recorder_pb.WatchStateRequest(), NO_CONTEXT)
        assert await longest_gap_s(reports) * LATE_REPORTS < SILENCE_S

    check()


def test_an_idle_bridge(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(BridgeServicer, "_state", lambda _: bridge_pb.WatchStateResponse())
    silence_s = BridgeLink("bridge", cast("Any", None))._silence_s

    @in_virtual_time
    async def check() -> None:
        servicer = BridgeServicer.__new__(BridgeServicer)
        servicer._status = cast("Any", SimpleNamespace(changes=Broadcast()))
        gap_s = await longest_gap_s(servicer.WatchState(bridge_pb.WatchStateRequest(), NO_CONTEXT))
        assert round(gap_s, 6) <= HEARTBEAT_S, "as the schema says"
        assert gap_s * LATE_REPORTS < silence_s

    check()
