"""What the recorder reads for viewers keeps no one else waiting: neither what records, nor other readers."""

import asyncio
import hashlib
import os
import time
from collections.abc import Awaitable
from contextlib import suppress
from pathlib import Path
from typing import Any

import grpc
import pytest

from omniseer.gateway.v1 import recording_pb2 as pb
from recorder.store.bundle_reader import ANSWER_WITHIN_S
from tests.support.recorder_in_process import Source
from tests.support.refusals import refused
from tests.support.served_recorder import Served, exported, served

LARGE = 50 * 1024**3
"""Sparse: it takes no room, and minutes to read."""
PROMPT_S = 3.0
"""A stop that waits for no viewer takes some 0.1 s."""
VIEWERS = 24
PATIENCE_S = 20.0
"""With a busy machine: the gateway waits for 5 s, for what takes the recorder ANSWER_WITHIN_S."""


def run_bundle(folder: Path, size: int, data: bytes = b"") -> Path:
    """A run bundle with one file of this size, which begins with some data."""
    folder.mkdir(parents=True)
    (folder / "manifest.yaml").write_text("state: complete\n", encoding="utf-8")
    path = folder / "video.ts"
    path.write_bytes(data)
    os.truncate(path, max(size, len(data)))
    return path


async def ends(call: Awaitable[Any]) -> None:
    with suppress(grpc.aio.AioRpcError):
        await call


async def stops_promptly(robot: Served) -> None:
    began_s = time.monotonic()
    stopped = await robot.stub.StopRecording(pb.StopRecordingRequest(request_id="stop"), timeout=20)
    assert stopped.recording.state == pb.RECORDING_STATE_COMPLETE
    assert time.monotonic() - began_s < PROMPT_S


@pytest.mark.timed
async def test_a_stop_does_not_wait_for_viewers_whose_files_are_hashed(tmp_path: Path) -> None:
    for number in range(VIEWERS):
        run_bundle(tmp_path / "runs" / f"run{number}", LARGE)
    async with served(tmp_path, run_bundles=[str(tmp_path / "runs")]) as robot:
        await robot.stub.StartRecording(pb.StartRecordingRequest(request_id="start"))
        Source(robot.running.queue).send(10)
        asked = [pb.GetRecordingRequest(recording_id=f"run-run{number}") for number in range(VIEWERS)]
        viewers = [asyncio.ensure_future(ends(robot.stub.GetRecording(each, timeout=5))) for each in asked]
        await asyncio.wait(viewers, timeout=0.5)
        await stops_promptly(robot)
        await asyncio.gather(*viewers)


@pytest.mark.timed
async def test_a_stop_does_not_wait_for_exports_that_begin_at_the_end(tmp_path: Path) -> None:
    async with served(tmp_path, segments={"max_bytes": 1024**3}) as robot:
        made = await robot.recorded(48 * 1024 * 1024, 24)
        await robot.stub.StartRecording(pb.StartRecordingRequest(request_id="start"))
        Source(robot.running.queue).send(10)
        file = made.files[0]
        request = pb.ExportRecordingRequest(recording_id=made.id, file=file.name, offset=file.size)
        for _ in range(200):
            call = robot.stub.ExportRecording(request)
            assert (await call.read()).HasField("header")
            call.cancel()
        await stops_promptly(robot)


async def test_a_bundle_that_is_read_shows_sums_later_and_the_caller_is_answered(tmp_path: Path) -> None:
    data = os.urandom(100_000)
    small = run_bundle(tmp_path / "runs" / "small", 0, data)
    run_bundle(tmp_path / "runs" / "large", LARGE)
    async with served(tmp_path, run_bundles=[str(tmp_path / "runs")]) as robot:
        asked = pb.GetRecordingRequest(recording_id="run-large")
        found = (await robot.stub.GetRecording(asked, timeout=PATIENCE_S)).recording
        assert {file.name: file.final for file in found.files} == {"manifest.yaml": True, "video.ts": False}
        assert ANSWER_WITHIN_S < 5
        large = exported(robot.stub, recording_id="run-large", file="video.ts")
        assert await refused(large) == (grpc.StatusCode.RESOURCE_EXHAUSTED, "TOO_MANY_REQUESTS")
        header, content = await exported(robot.stub, recording_id="run-small", file=small.name)
        assert (header.sha256, content) == (hashlib.sha256(data).digest(), data)


async def test_bundles_beyond_those_that_are_read_are_refused_with_what_to_do(tmp_path: Path) -> None:
    for number in range(5):
        run_bundle(tmp_path / "runs" / f"run{number}", LARGE)
    async with served(tmp_path, run_bundles=[str(tmp_path / "runs")]) as robot:
        answers = await asyncio.gather(
            *(
                robot.stub.GetRecording(
                    pb.GetRecordingRequest(recording_id=f"run-run{number}"), timeout=PATIENCE_S
                )
                for number in range(5)
            ),
            return_exceptions=True,
        )
        (refusal,) = [each for each in answers if isinstance(each, grpc.aio.AioRpcError)]
        assert refusal.code() == grpc.StatusCode.RESOURCE_EXHAUSTED
        assert "try again later" in (refusal.details() or "")
