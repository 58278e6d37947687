"""PTS is the capture time on CLOCK_MONOTONIC plus a constant, whatever happens to the pipeline."""

import asyncio
import queue
import signal
import statistics
import subprocess
import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from bench.video.camera import Camera, camera
from bench.video.foreign import environment
from common.gst import Gst, stop_element
from console.client.results import StreamContainer, StreamEndpoint, StreamTransport, VideoCodec
from omniseer.preview.v1 import preview_service_pb2 as pb
from preview.pipeline import builder, capture_clock
from preview.pipeline.runner import Runner
from tests.support.film import clip
from tests.support.judges import complaints, decoded_frames, stamps
from tests.support.mpegts import CLOCK_LIMIT_MS, Stream, analyse
from tests.support.pipeline_contract import LIVE, Events, plan_of
from tests.support.promise import MS, keeps
from tests.support.recording import record
from tests.support.running_preview import RunningPreview
from tests.support.waiting import wait_until

pytestmark = pytest.mark.gst

WITHIN_MS = 2.0
RECORD_S = 1.5
OFFSET_NS = -3_600 * 1_000_000_000
WRAP_TICKS = 1 << 33
WRAP_NS = WRAP_TICKS * 100_000 // 9
PLAUSIBLE_MS = 150.0
"""From capture to arrival, with an SRT latency of 20 ms, on a machine that does other things as well."""


@pytest.fixture(scope="module")
def stamping(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Camera]:
    """A camera that draws the time of capture into each frame."""
    with camera(tmp_path_factory.mktemp("camera")) as made:
        yield made


def endpoint(offset_ns: int) -> StreamEndpoint:
    return StreamEndpoint(
        transport=StreamTransport.SRT,
        host="127.0.0.1",
        port=7100,
        uri="",
        latency_ms=20,
        codec=VideoCodec.H264,
        container=StreamContainer.MPEG_TS,
        encrypted=False,
        passphrase="",
        capture_offset_ns=offset_ns,
    )


def captured_s(pts: int, offset_ns: int = OFFSET_NS) -> float:
    """As the client library computes it."""
    captured_ns = endpoint(offset_ns).captured_ns(pts, time.monotonic_ns())
    assert captured_ns is not None
    return captured_ns / 1e9


def errors_ms(preview: RunningPreview, directory: Path) -> list[float]:
    """How much later than its stamp each frame of the running stream says that it was captured."""
    offset_ns = preview.running().listener.capture_offset_ns
    data = record(preview.port, RECORD_S)
    stream = analyse(data)
    recording = directory / "recording.ts"
    recording.write_bytes(data[: stream.whole_bytes])
    stamped = stamps(recording)
    # The last access unit is not whole; no picture is out of order.
    units = stream.access_units[: len(stamped)]
    assert len(units) >= len(stream.access_units) - 1
    assert units[0].key
    return [
        (captured_s(unit.pts, offset_ns) - at_s) * 1000
        for unit, at_s in zip(units, stamped, strict=True)
        if at_s is not None
    ]


def is_true(preview: RunningPreview, directory: Path, what: str) -> None:
    """Judges the frames that were handed over soonest, the 5th percentile.

    An error of the mapping is in every frame. What a busy machine adds is not: it copies and reads the shared
    memory late, and a frame is stamped when it is read.
    """

    def error_ms() -> float:
        found = errors_ms(preview, directory)
        soonest, half, most = (statistics.quantiles(found, n=20)[at] for at in (0, 9, 18))
        print(f"{what}: {len(found)} frames, {soonest:.2f}, {half:.2f}, {most:.2f} ms (5, 50, 95 %)")
        assert len(found) > RECORD_S * 10
        assert min(found) > -WITHIN_MS, "captured before its stamp"
        return soonest

    keeps(WITHIN_MS, f"ms after the stamp, {what}", error_ms, per_stalled_s=MS)


@pytest.mark.timed
def test_it_is_true_over_switches_fallback_and_restart(tmp_path: Path, stamping: Camera) -> None:
    settings = {
        "source": {"kind": "gst", "description": stamping.source},
        "encoders": {"order": ["mpp-h264", "x264"], "probe_timeout_s": 4},
    }
    with RunningPreview(tmp_path, settings, {"mpph264enc": "later error:150"}, small=False) as preview:
        preview.enable(pb.PROFILE_LOW_BW)
        preview.wait_for(
            lambda a: a.encoder.name == "mpp-h264" and a.state == pb.LIFECYCLE_STATE_RUNNING, "it"
        )
        is_true(preview, tmp_path, "first encoder")
        preview.wait_for(
            lambda a: a.encoder.name == "x264" and a.state == pb.LIFECYCLE_STATE_RUNNING, "fallback"
        )
        is_true(preview, tmp_path, "after a fallback")
        preview.enable(pb.PROFILE_BALANCED)
        preview.wait_for(lambda a: a.measurement.fps > 25, "30 fps")
        is_true(preview, tmp_path, "after a switch")
        preview.process.send_signal(signal.SIGKILL)
        preview.process.wait(20)
        preview.start_again()
        preview.enable(pb.PROFILE_BALANCED)
        preview.running()
        is_true(preview, tmp_path, "after a restart")


def ages_ms(port: int, count: int) -> list[float]:
    """How old frames are when their first packet arrives, without SRT's latency."""
    ages: list[float] = []

    def arrived(_sink: Any, buffer: Any, _pad: Any) -> None:
        now_s = time.monotonic()
        units = analyse(with_tables[0] + buffer.extract_dup(0, buffer.get_size())).access_units
        ages.extend((now_s - captured_s(unit.pts)) * 1000 - 20 for unit in units)

    with_tables = [_tables(port)]
    pipeline = Gst.parse_launch(
        f"srtsrc uri=srt://127.0.0.1:{port}?mode=caller latency=20 ! fakesink name=out sync=false"
        " signal-handoffs=true"
    )
    pipeline.get_by_name("out").connect("handoff", arrived)
    pipeline.set_state(Gst.State.PLAYING)
    try:
        wait_until(lambda: len(ages) >= count, f"{count} frames")
    finally:
        pipeline.set_state(Gst.State.NULL)
    return ages


def _tables(port: int) -> bytes:
    """PAT and PMT, the first packets that a viewer gets."""
    return record(port, 0.1)[: 2 * 188]


SOURCES = {
    "test": {"kind": "test"},
    "gst, live": {"kind": "gst", "description": f"{LIVE} ! video/x-raw,framerate=25/1"},
    "gst, paced by itself": {
        "kind": "gst",
        "description": "videotestsrc ! video/x-raw,framerate=25/1 ! identity sync=true",
    },
}


@pytest.mark.parametrize("name", SOURCES)
@pytest.mark.timed
def test_each_kind_of_source_stamps_the_capture(tmp_path: Path, name: str) -> None:
    with RunningPreview(tmp_path, {"source": SOURCES[name]}) as preview:
        preview.enable()
        preview.running()
        plausible(preview)


def test_a_camera_started_later_stamps_the_capture_if_its_segment_came_before() -> None:
    """A source that isn't live sends it at once, on a thread of its own, and waits with the frames."""
    pipeline, began_ns = Gst.Pipeline.new(), time.monotonic_ns()
    capture_clock.use(pipeline)
    first = builder.build_source(plan_of(LIVE))
    later = builder.build_source(plan_of(str(SOURCES["gst, paced by itself"]["description"])))
    later.set_locked_state(True)
    came: queue.Queue[int] = queue.Queue()

    def take(_pad: Any, info: Any) -> Any:
        came.put(info.get_buffer().pts)
        return Gst.PadProbeReturn.DROP

    for source in (first, later):
        pipeline.add(source)
    first.get_static_pad("src").add_probe(Gst.PadProbeType.BUFFER, lambda *_: Gst.PadProbeReturn.DROP)
    later.get_static_pad("src").add_probe(Gst.PadProbeType.BUFFER, take)
    try:
        capture_clock.play(pipeline, first)
        wait_until(lambda: time.monotonic_ns() - began_ns > 10**9, "the pipeline's time is not the source's")
        capture_clock.play_beside(
            _AfterItsSegment(pipeline, later), later, later.get_by_name(builder.SOURCE_TIME)
        )
        began_later_ns = later.get_base_time() - pipeline.get_base_time()
        assert [came.get(timeout=20) for _ in range(3)] == [
            began_later_ns + due_ms * 1_000_000 for due_ms in (0, 40, 80)
        ]
    finally:
        stop_element(later)
        stop_element(pipeline)


class _AfterItsSegment:
    """A pipeline whose time is asked for when a source in it has passed on its segment."""

    def __init__(self, pipeline: Any, source: Any) -> None:
        self._pipeline = pipeline
        self._pad = source.get_by_name(builder.SOURCE_END).get_static_pad("sink")

    def get_pipeline_clock(self) -> Any:
        wait_until(lambda: self._pad.get_sticky_event(Gst.EventType.SEGMENT, 0) is not None, "its segment")
        return self._pipeline.get_pipeline_clock()

    def get_base_time(self) -> int:
        return int(self._pipeline.get_base_time())


@pytest.mark.timed
def test_a_file_stamps_when_a_frame_is_due_also_after_its_end(tmp_path: Path) -> None:
    film = clip(1.0, tmp_path / "film.mkv")
    with RunningPreview(tmp_path, {"source": {"kind": "file", "path": str(film)}}) as preview:
        preview.enable()
        preview.running()
        plausible(preview)
        over_s = time.monotonic() + 2.5
        wait_until(lambda: time.monotonic() > over_s, "the film has begun again twice")
        plausible(preview)


def plausible(preview: RunningPreview) -> None:
    def typical_ms() -> float:
        ages = ages_ms(preview.port, 40)
        print(f"{min(ages):.1f} to {max(ages):.1f} ms old on arrival")
        assert min(ages) > -1, "no frame comes before its capture"
        return statistics.median(ages)

    keeps(PLAUSIBLE_MS, "ms from capture to arrival", typical_ms, per_stalled_s=MS)


class _Later:
    """A source whose time is ahead of the clock."""

    def __init__(self, source: Any, ahead_ns: int) -> None:
        self._pad = source.get_static_pad("src")
        self._ahead_ns = ahead_ns

    def get_static_pad(self, _name: str) -> "_Later":
        return self

    def set_offset(self, offset_ns: int) -> None:
        self._pad.set_offset(offset_ns + self._ahead_ns)


async def streamed(monkeypatch: pytest.MonkeyPatch, begins_ns: int, seconds: float) -> bytes:
    """What a viewer of a real pipeline gets whose clock stands at `begins_ns` when it starts."""
    ahead_ns, play = begins_ns - time.monotonic_ns(), capture_clock.play
    monkeypatch.setattr(
        capture_clock, "play", lambda pipeline, source: play(pipeline, _Later(source, ahead_ns))
    )
    events, plan = Events(), plan_of(LIVE)
    runner = Runner(plan, events)
    await runner.start()
    await events.wait_for("first_frame")
    try:
        return await asyncio.to_thread(record, plan.srt.port, seconds)
    finally:
        assert await (await runner.stop())


def steps(values: list[int]) -> list[int]:
    """The distances between neighbours, as a clock of 33 bits has them."""
    return [(later - earlier) % WRAP_TICKS for earlier, later in pairwise(values)]


def unwrapped_by_ffprobe(recording: Path) -> list[int]:
    command = ["ffprobe", "-v", "error", "-show_entries", "packet=pts", "-of", "csv=p=0", str(recording)]
    found = subprocess.run(command, env=environment(), capture_output=True, text=True, check=True).stdout
    return [int(line.strip(",")) for line in found.split()]


def unwrapped_by_gstreamer(recording: Path) -> list[int]:
    pipeline = Gst.parse_launch(
        f"filesrc location={recording} ! tsdemux ! h264parse ! appsink name=out sync=false"
    )
    pipeline.set_state(Gst.State.PLAYING)
    out, found = pipeline.get_by_name("out"), []
    while sample := out.emit("try-pull-sample", 5 * Gst.SECOND):
        found.append(sample.get_buffer().pts)
    pipeline.set_state(Gst.State.NULL)
    return found


def clock_gaps_ms(stream: Stream) -> list[float]:
    """Where clock references are further apart than promised, over the wrap of their 33 bits as well."""
    distances = [(later - earlier) % (WRAP_TICKS / 90) for earlier, later in pairwise(stream.clock_times_ms)]
    return [each for each in distances if each > CLOCK_LIMIT_MS]


def skips_ms(stamped: list[int]) -> list[float]:
    """Where the source skipped frames; at 30 frames per second the clock comes with the frames."""
    return [step / 90 for step in steps(stamped) if step / 90 > CLOCK_LIMIT_MS]


def clock_is_ahead_of_no_frame(stream: Stream) -> bool:
    """Whether the clock stays within a second before the frames."""
    lead_ms = (stream.access_units[0].pts / 90 - stream.clock_times_ms[0]) % (WRAP_TICKS / 90)
    return 0 <= lead_ms < 1000


@pytest.mark.parametrize(
    ("begins_ns", "wraps"),
    [
        pytest.param(WRAP_NS + OFFSET_NS - 2_500_000_000, True, id="first-wrap"),
        pytest.param(7 * WRAP_NS + OFFSET_NS - 2_500_000_000, True, id="seventh-wrap"),
        pytest.param(400 * 86_400 * 1_000_000_000, False, id="after-400-days"),
    ],
)
async def test_the_stream_goes_on_when_pts_wraps(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, begins_ns: int, wraps: bool
) -> None:
    data = await streamed(monkeypatch, begins_ns, 5)
    stream = analyse(data)
    stamped = [unit.pts for unit in stream.access_units]
    assert (stamped != sorted(stamped)) is wraps
    # A live source skips frames where it waits for a processor, for seconds on a machine that stalls.
    assert set(steps(stamped)) <= {3000 * frames for frames in range(1, 5 * 30)}
    assert stream.counter_gaps == []
    assert clock_gaps_ms(stream) == pytest.approx(skips_ms(stamped), abs=1)
    assert clock_is_ahead_of_no_frame(stream)
    recording = tmp_path / "recording.ts"
    recording.write_bytes(data[: stream.whole_bytes])
    assert complaints(recording) == ""
    frames = decoded_frames(recording)
    assert frames >= len(stamped) - 1
    by_ffprobe = unwrapped_by_ffprobe(recording)
    assert by_ffprobe == [by_ffprobe[0] + sum(steps(stamped)[:place]) for place in range(len(by_ffprobe))]
    by_gstreamer = unwrapped_by_gstreamer(recording)
    assert len(by_gstreamer) >= frames - 1
    between_ms = [(later - earlier) / 1e6 for earlier, later in pairwise(by_gstreamer)]
    expected_ms = [each / 90 for each in steps(stamped)]
    assert between_ms == pytest.approx(expected_ms[: len(between_ms)], abs=3.5)


@pytest.mark.parametrize("days", [0, 1, 2, 400])
@pytest.mark.parametrize("off_s", [-40_000, 0, 40_000])
def test_the_client_library_knows_the_wrap(days: int, off_s: int) -> None:
    captured_ns = days * 86_400 * 1_000_000_000 + 123_456_789_000
    pts = (captured_ns - OFFSET_NS) * 9 // 100_000 % WRAP_TICKS
    found = endpoint(OFFSET_NS).captured_ns(pts, captured_ns + off_s * 1_000_000_000)
    assert found == pytest.approx(captured_ns, abs=12_000)


def test_where_pts_does_not_say_the_client_library_does_not_guess() -> None:
    unknown = replace(endpoint(0), capture_offset_ns=None)
    assert unknown.captured_ns(1, time.monotonic_ns()) is None
