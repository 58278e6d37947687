"""What viewers request and report, through a gateway to the preview service."""

import asyncio
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import grpc
import pytest

from common.errors import NotRunningError
from common.reasons import Reason
from common.refusal import refusal_in
from gateway.links.preview import wire
from gateway.links.preview.feedback import Feedback
from gateway.links.preview.wire import PreviewConnector
from gateway.rpc.connections.admission import METHOD_RATES
from gateway.status.preview import PreviewState
from omniseer.gateway.v1.preview_pb2 import PICTURE_DELIVERY_DIRECT, PICTURE_DELIVERY_SRT_LATENCY
from omniseer.gateway.v1.robot_gateway_pb2 import ReportPictureRequest, RequestKeyFrameRequest
from omniseer.gateway.v1.states_pb2 import PREVIEW_RUNNING
from omniseer.preview.v1 import preview_service_pb2 as pb
from tests.support.eventually import eventually
from tests.support.preview_double import PreviewDouble, serve_double
from tests.support.running_gateway import Operator, running_gateway
from tests.support.status import OFF
from tests.support.undisturbed import no_stall, undisturbed_async

FAST_ENOUGH_S = 5.0
DEADLINE_S = wire._FEEDBACK_DEADLINE_S


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the gateway with a double that a busy machine holds up; one test alone is about it."""
    monkeypatch.setattr(wire, "_FEEDBACK_DEADLINE_S", 2 * FAST_ENOUGH_S)


@asynccontextmanager
async def robot(socket: Path, double: PreviewDouble) -> AsyncIterator[Operator]:
    server = await serve_double(socket, double)
    try:
        async with running_gateway(socket) as operator:
            yield operator
    finally:
        await server.stop(None)


async def turned_on(operator: Operator, double: PreviewDouble, viewers: int = 1) -> None:
    """Enables the preview; so many viewers are on its stream."""
    double.actual.measurement.CopyFrom(pb.Measurement(fps=30, viewer_count=viewers))
    await operator.switch(True)
    await eventually(
        operator.status,
        lambda status: status.preview.state == PREVIEW_RUNNING and status.preview.measured.available,
        "the stream is measured",
    )


async def report(operator: Operator, **fields: Any) -> None:
    await operator.stub.ReportPicture(ReportPictureRequest(**fields), timeout=FAST_ENOUGH_S)


async def refused(call: Any) -> tuple[grpc.StatusCode, str, str]:
    """The code, reason and text that a call is refused with."""
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await call
    error = caught.value
    return error.code(), refusal_in(error.trailing_metadata()).reason, error.details() or ""


def key_frame(operator: Operator, newest_pts: int | None = None) -> Any:
    return operator.stub.RequestKeyFrame(RequestKeyFrameRequest(newest_pts=newest_pts), timeout=FAST_ENOUGH_S)


async def test_a_request_for_a_key_frame_reaches_the_preview(tmp_path: Path) -> None:
    double = PreviewDouble()
    async with robot(tmp_path / "preview.sock", double) as operator:
        await turned_on(operator, double)
        assert (await key_frame(operator, 1 << 32)).forced
        assert not (await key_frame(operator)).forced, "another request's serves it"
        first, second = double.key_frames_requested
        assert first.newest_pts == 1 << 32
        assert not second.HasField("newest_pts")


class WithoutVideo(PreviewDouble):
    """Has just lost its picture, of which the gateway has yet to learn."""

    async def RequestKeyFrame(self, _request: Any, context: Any) -> Any:  # noqa: N802  # grpc's name
        await context.abort(grpc.StatusCode.FAILED_PRECONDITION, "the double makes no video")


async def test_without_video_a_request_is_refused_with_what_to_do(tmp_path: Path) -> None:
    double = WithoutVideo()
    async with robot(tmp_path / "preview.sock", double) as operator:
        code, reason, text = await refused(key_frame(operator))
        assert (code, reason) == (grpc.StatusCode.FAILED_PRECONDITION, Reason.PREVIEW_NOT_RUNNING)
        assert text == "the preview is off; turn it on first"
        await turned_on(operator, double)
        code, reason, text = await refused(key_frame(operator))
        assert (code, reason) == (grpc.StatusCode.FAILED_PRECONDITION, Reason.PREVIEW_NOT_RUNNING)
        assert "the double makes no video" in text


async def test_a_preview_service_that_hangs_does_not_keep_the_caller(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(wire, "_FEEDBACK_DEADLINE_S", DEADLINE_S)

    async def attempt() -> None:
        double = PreviewDouble()
        # A stall may last until the link to a service without a report is lost.
        with no_stall():
            async with robot(tmp_path / "preview.sock", double) as operator:
                await turned_on(operator, double)
                double.thawed.clear()
                # Sooner than its caller's own deadline.
                code, reason, text = await refused(key_frame(operator))
                assert (code, reason) == (grpc.StatusCode.FAILED_PRECONDITION, Reason.PREVIEW_NOT_RUNNING)
                assert "does not answer" in text
                double.thawed.set()

    await undisturbed_async(attempt)


async def test_a_link_that_drops_under_a_request_refuses_it(tmp_path: Path) -> None:
    """The defect: the closed channel cancelled the caller's own task, and the caller got CANCELLED."""
    asked = asyncio.Event()

    class Silent(PreviewDouble):
        async def RequestKeyFrame(self, _request: Any, _context: Any) -> Any:  # noqa: N802  # grpc's name
            asked.set()
            await asyncio.Event().wait()

    socket = tmp_path / "preview.sock"
    server = await serve_double(socket, Silent())
    feedback = Feedback(PreviewConnector(socket))
    running = replace(OFF, state=PreviewState.RUNNING)
    try:
        async with feedback.connect():
            dropped = asyncio.create_task(feedback.request_key_frame(running, None))
            await asked.wait()
        with pytest.raises(NotRunningError, match="can't be reached at the moment"):
            await dropped
        asked.clear()
        async with feedback.connect():
            cancelled = asyncio.create_task(feedback.request_key_frame(running, None))
            await asked.wait()
            cancelled.cancel()
            with pytest.raises(asyncio.CancelledError):
                await cancelled
    finally:
        await server.stop(None)


async def test_the_worst_age_is_shown_and_passed_on(tmp_path: Path) -> None:
    double = PreviewDouble()
    async with robot(tmp_path / "preview.sock", double) as operator:
        await turned_on(operator, double, viewers=2)
        measured = (await operator.status()).preview.measured
        assert (measured.HasField("worst_picture_age_ms"), measured.reporting_viewer_count) == (False, 0)
        assert not measured.HasField("most_packets_given_up")
        direct = {"delivery": PICTURE_DELIVERY_DIRECT, "packets_given_up": 7}
        await report(operator, viewer_id="left", picture_age_ms=90, **direct)
        late = {"delivery": PICTURE_DELIVERY_SRT_LATENCY}
        await report(operator, viewer_id="right", picture_age_ms=200, picture_age_error_ms=80, **late)
        measured = (
            await eventually(
                operator.status, lambda s: s.preview.measured.reporting_viewer_count == 2, "both count"
            )
        ).preview.measured
        assert measured.worst_picture_age_ms == 200
        assert (measured.direct_viewer_count, measured.srt_latency_viewer_count) == (1, 1)
        assert measured.most_packets_given_up == 7

        async def passed_on() -> list[int]:
            return double.picture_ages_ms

        # The newest is always passed on; the first may have been replaced before it was.
        await eventually(passed_on, lambda ages: ages[-1:] == [120], "the age less its error")


async def test_a_slow_computer_of_a_viewer_costs_the_others_no_bit_rate(tmp_path: Path) -> None:
    double = PreviewDouble()
    async with robot(tmp_path / "preview.sock", double) as operator:
        await turned_on(operator, double)
        await report(operator, picture_age_ms=900, link_age_ms=30)

        async def passed_on() -> list[int]:
            return double.picture_ages_ms

        assert await eventually(passed_on, bool, "an age") == [30]
        assert (await operator.status()).preview.measured.worst_picture_age_ms == 900


async def test_without_a_viewer_on_the_stream_no_report_counts(tmp_path: Path) -> None:
    double = PreviewDouble()
    async with robot(tmp_path / "preview.sock", double) as operator:
        await turned_on(operator, double, viewers=0)
        await report(operator, picture_age_ms=900)
        measured = (await operator.status()).preview.measured
        assert (measured.HasField("worst_picture_age_ms"), measured.reporting_viewer_count) == (False, 0)
        await turned_on(operator, double, viewers=1)
        await eventually(operator.status, lambda s: s.preview.measured.viewer_count, "a viewer")
        await report(operator, picture_age_ms=140)

        async def passed_on() -> list[int]:
            return double.picture_ages_ms

        assert await eventually(passed_on, bool, "an age") == [140], "the earlier one was not passed on"


@pytest.mark.parametrize(
    "fields",
    [
        {"viewer_id": "x" * 65},
        {"viewer_id": "a\x1b[2J"},
        {"viewer_id": "\u202e"},
        {"picture_age_ms": 60_001},
        {"picture_age_error_ms": 60_001},
        {"rtt_ms": 60_001},
        {"link_age_ms": 60_001},
        {"loss_percent": -1.0},
        {"loss_percent": 100.5},
        {"loss_percent": float("nan")},
        {"delivery": 99},
    ],
    ids=str,
)
async def test_a_report_out_of_its_bounds_is_refused(tmp_path: Path, fields: dict[str, Any]) -> None:
    double = PreviewDouble()
    async with robot(tmp_path / "preview.sock", double) as operator:
        code, reason, text = await refused(report(operator, **fields))
        assert (code, reason) == (grpc.StatusCode.INVALID_ARGUMENT, Reason.INVALID_REQUEST)
        assert text.startswith(next(iter(fields)))


async def test_a_connection_that_floods_is_refused(tmp_path: Path) -> None:
    double = PreviewDouble()
    async with robot(tmp_path / "preview.sock", double) as operator:
        await turned_on(operator, double)
        rate, began_s = METHOD_RATES["RequestKeyFrame"], time.monotonic()
        calls = [key_frame(operator) for _ in range(30)]
        results = await asyncio.gather(*calls, return_exceptions=True)
        took_s = time.monotonic() - began_s
        refusals = [each for each in results if isinstance(each, BaseException)]
        codes = {each.code() if isinstance(each, grpc.aio.AioRpcError) else each for each in refusals}
        assert codes == {grpc.StatusCode.RESOURCE_EXHAUSTED}
        assert rate <= len(results) - len(refusals) <= rate * (1 + took_s)
        assert (await operator.status()).preview.state, "other methods have buckets of their own"
