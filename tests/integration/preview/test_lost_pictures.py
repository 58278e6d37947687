"""Key frames for viewers that lost a picture: how soon they come, and how many at most."""

import asyncio
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from typing import Any

import grpc
import pytest

from common.gst import Gst
from console.client import GatewayClient
from omniseer.preview.v1 import preview_service_pb2 as pb
from tests.support.mpegts import PACKET_BYTES, AccessUnit, analyse
from tests.support.promise import MS, keeps_async
from tests.support.recording import record
from tests.support.running_gateway import running_gateway
from tests.support.running_preview import RunningPreview
from tests.support.undisturbed import no_stall, undisturbed
from tests.support.waiting import wait_until

pytestmark = pytest.mark.gst

KEY_FRAME_WITHIN_MS = 60.0
"""From the request to the key frame's arrival, at 30 frames per second and more, on one machine."""
FLOOD_S = 4.0
BURST, PER_S = 3, 5.0


class Arrivals:
    """A viewer that notes when each key frame's first packet arrives; SRT's latency is taken off."""

    LATENCY_S = 0.02

    def __init__(self, port: int) -> None:
        self.at_s: list[float] = []
        self._pipeline = Gst.parse_launch(
            f"srtsrc uri=srt://127.0.0.1:{port}?mode=caller latency={round(self.LATENCY_S * 1000)}"
            " ! fakesink name=out sync=false signal-handoffs=true"
        )
        self._pipeline.get_by_name("out").connect("handoff", self._arrived)

    def _arrived(self, _sink: Any, buffer: Any, _pad: Any) -> None:
        data = buffer.extract_dup(0, buffer.get_size())
        # random_access_indicator (ISO/IEC 13818-1 2.4.3.5).
        packets = range(0, len(data) - PACKET_BYTES + 1, PACKET_BYTES)
        if any(data[at + 3] & 0x20 and data[at + 4] and data[at + 5] & 0x40 for at in packets):
            self.at_s.append(time.monotonic() - self.LATENCY_S)

    @contextmanager
    def watching(self) -> Iterator[None]:
        self._pipeline.set_state(Gst.State.PLAYING)
        try:
            wait_until(lambda: self.at_s, "the key frame of joining")
            yield
        finally:
            self._pipeline.set_state(Gst.State.NULL)


def request(preview: RunningPreview, newest_pts: int | None = None) -> bool:
    return preview.stub.RequestKeyFrame(pb.RequestKeyFrameRequest(newest_pts=newest_pts), timeout=20).forced


def keys(units: list[AccessUnit]) -> list[int]:
    return [unit.pts for unit in units if unit.key]


def worst_wait_ms(arrivals: Arrivals, request_one: Callable[[], bool]) -> float:
    """The longest but one of eight waits from a request to its key frame."""
    waits = []
    for _ in range(8):
        # The buckets refill, so that only the encoder's next frame is waited for.
        threading.Event().wait(0.4)
        before, at_s = len(arrivals.at_s), time.monotonic()
        assert request_one()
        wait_until(lambda before=before: len(arrivals.at_s) > before, "a key frame", 2)  # type: ignore[misc]
        waits.append((arrivals.at_s[before] - at_s) * 1000)
    print(", ".join(f"{wait:.0f}" for wait in waits), "ms")
    return sorted(waits)[-2]


@pytest.mark.timed
async def test_a_key_frame_arrives_in_time(preview: RunningPreview) -> None:
    """From an operator's call through the gateway to the stream."""

    def worst_ms() -> float:
        with GatewayClient(f"127.0.0.1:{operator.port}") as robot, arrivals.watching():
            return worst_wait_ms(arrivals, lambda: robot.request_key_frame().forced)

    async with running_gateway(preview.socket) as operator:
        await operator.switch(True)
        arrivals = Arrivals(preview.port)
        await keeps_async(
            KEY_FRAME_WITHIN_MS, "ms to a key frame", partial(asyncio.to_thread, worst_ms), per_stalled_s=MS
        )


def test_a_key_frame_that_is_on_its_way_serves_a_loss(preview: RunningPreview) -> None:
    preview.enable()
    preview.running()
    with ThreadPoolExecutor(1) as viewer:
        recording = viewer.submit(record, preview.port, 4.0)
        preview.wait_for(lambda a: a.measurement.viewer_count == 1, "a viewer")
        wait_until(lambda: request(preview), "the key frame of joining is out, another is requested")
        units = analyse(recording.result()).access_units
    # The encoder makes key frames of its own between those that are requested, and after them.
    joined, *_, newest = keys(units)
    assert units[0].pts == joined
    assert not request(preview, joined), "the requested one was made after this loss"
    assert request(preview, newest), "none was made after this one"


def test_without_video_there_is_no_key_frame(preview: RunningPreview) -> None:
    with pytest.raises(grpc.RpcError) as caught:
        request(preview)
    error: Any = caught.value
    assert (error.code(), error.details()) == (
        grpc.StatusCode.FAILED_PRECONDITION,
        "the preview is disabled",
    )


def test_a_flood_of_requests_forces_five_key_frames_a_second(preview: RunningPreview) -> None:
    def flood() -> None:
        # The viewer of an earlier attempt has gone.
        preview.wait_for(lambda a: a.measurement.viewer_count == 0, "no viewer")
        with no_stall(), ThreadPoolExecutor(1) as viewer:
            recording = viewer.submit(record, preview.port, FLOOD_S)
            preview.wait_for(lambda a: a.measurement.viewer_count == 1, "a viewer")
            calls = 0
            while not recording.done():
                request(preview)
                calls += 1
            stream = analyse(recording.result())
            assert calls > 100
            found = len(keys(stream.access_units))
            # The regular ones and that of joining on top.
            assert PER_S * FLOOD_S / 2 < found <= BURST + PER_S * FLOOD_S + FLOOD_S / 2 + 2
            assert stream.counter_gaps == []

    preview.enable()
    preview.running()
    undisturbed(flood)
    assert preview.running().counters == pb.Counters(starts=1)
