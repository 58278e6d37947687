"""What a preset takes, by its last recording: consoles and the disk's fault reckon the room with it."""

import time
from pathlib import Path
from typing import Any

import pytest

from recorder.recording.requests import StartOptions
from recorder.store.manifest import Manifest, StopReason
from recorder.values import VIDEO_TOPIC, GapCause, Loss
from tests.support.recorder_in_process import Running, Source, channel, running_recorder

VIDEO: dict[str, Any] = {
    "presets": {"all": {"topics": ["*"], "video": True}},
    "video": {"socket": "/run/robot-gateway/video-tap.sock"},
}
MINUTE_NS = 60 * 1_000_000_000


@pytest.fixture(autouse=True)
def _of_any_length(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("recorder.recording.manual_recorder._MEASURED_S", 0.0)


async def recorded(running: Running, request_id: str, *, with_video: bool, frames: int = 0) -> Manifest:
    await running.operations.start(request_id, StartOptions(with_video=with_video))
    Source(running.queue).send(10)
    Source(running.queue, channel(VIDEO_TOPIC)).send(frames, size=500_000)
    done = (await running.operations.stop(f"stop {request_id}", "")).recording
    assert done
    assert done.video_frames == frames
    return done


async def test_a_recording_without_video_says_nothing_of_those_with_it(tmp_path: Path) -> None:
    """The defect: the room grew ninetyfold, and the disk's fault went, by one `--no-video`."""
    async with running_recorder(tmp_path, **VIDEO) as running:
        await recorded(running, "1", with_video=True, frames=20)
        measured = running.status_reader.bytes_per_minute["all"]
        assert measured > 20 * 500_000
        await recorded(running, "2", with_video=False)
        assert running.status_reader.bytes_per_minute["all"] == measured
    async with running_recorder(tmp_path, presets=VIDEO["presets"]) as running:
        assert 0 < running.status_reader.bytes_per_minute["all"] < measured, "a robot without video"


async def test_a_recording_whose_video_never_came_says_nothing_of_those_with_it(tmp_path: Path) -> None:
    async with running_recorder(tmp_path, **VIDEO) as running:
        await recorded(running, "1", with_video=True)
        assert running.status_reader.bytes_per_minute["all"] == 0, "not measured yet"


async def test_a_recording_that_lacks_much_of_its_video_is_no_measure(tmp_path: Path) -> None:
    async with running_recorder(tmp_path, **VIDEO) as running:
        video = Source(running.queue, channel(VIDEO_TOPIC))
        await running.operations.start("1", StartOptions())
        video.send()
        now_ns = time.time_ns()
        running.queue.put([Loss(video.of, GapCause.VIDEO, now_ns - MINUTE_NS, now_ns, None)])
        done = (await running.operations.stop("2", "")).recording
        assert done
        assert running.status_reader.bytes_per_minute["all"] == 0


async def test_what_a_recording_took_that_ended_by_itself_outlives_the_recorder(tmp_path: Path) -> None:
    async with running_recorder(tmp_path) as running:
        await running.operations.start("1", StartOptions(max_bytes=1))
        Source(running.queue).send(10)
        await running.until(lambda: running.status_reader.running is None)
        assert running.status_reader.newest
        assert running.status_reader.newest.stop_reason is StopReason.LIMIT
        measured = running.status_reader.bytes_per_minute["all"]
        assert measured > 0
    async with running_recorder(tmp_path) as running:
        assert running.status_reader.bytes_per_minute["all"] == measured
