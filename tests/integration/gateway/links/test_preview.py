"""The gateway against a preview service that comes late, dies, freezes and refuses, over real sockets."""

import asyncio
import gc
import os
import signal
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import grpc
import pytest

from omniseer.gateway.v1 import preview_pb2 as pb
from omniseer.gateway.v1 import states_pb2 as states
from tests.support.eventually import eventually
from tests.support.preview_double import Behaviour, PreviewDouble, double_process, serve_double
from tests.support.running_gateway import Operator, running_gateway


@pytest.fixture
def socket(tmp_path: Path) -> Path:
    return tmp_path / "preview.sock"


@pytest.fixture
async def operator(socket: Path) -> AsyncIterator[Operator]:
    async with running_gateway(socket) as operator:
        yield operator


async def in_contact(operator: Operator) -> None:
    await eventually(operator.status, lambda it: it.preview.service_reachable, "contact with the service")


async def until(operator: Operator, state: int, within_s: float = 15.0) -> Any:
    return await eventually(
        operator.status,
        lambda it: it.preview.state == state,
        states.PreviewState.Name(state),  # type: ignore[arg-type]
        within_s,
    )


async def test_a_service_that_comes_late_gets_the_desired_state(operator: Operator, socket: Path) -> None:
    reply = await operator.switch(True, pb.PREVIEW_PROFILE_LOW_BW)
    assert reply.accepted
    assert reply.preview.state == states.PREVIEW_FAULTED
    assert "preview service unreachable" in reply.message
    assert "Start or restart it" in reply.message
    assert not reply.preview.service_reachable

    double = PreviewDouble()
    server = await serve_double(socket, double)
    try:
        status = await until(operator, states.PREVIEW_RUNNING)
        assert status.preview.profile == pb.PREVIEW_PROFILE_LOW_BW
        assert status.preview.last_error == ""
        assert [desired.enabled for desired in double.applied] == [True]
    finally:
        await server.stop(None)


@pytest.mark.timed
async def test_a_killed_service_is_a_fault_and_its_successor_gets_the_desired_state(
    operator: Operator, socket: Path
) -> None:
    with double_process(socket) as first:
        await in_contact(operator)
        assert (await operator.switch(True)).preview.state == states.PREVIEW_RUNNING
        first.kill()
        faulted = await until(operator, states.PREVIEW_FAULTED)
        assert "unreachable" in faulted.preview.last_error
        assert not faulted.preview.HasField("video")
    with double_process(socket):
        back_s = time.monotonic()
        status = await until(operator, states.PREVIEW_RUNNING)
        assert time.monotonic() - back_s < 5
        counters = status.preview.counters
        assert (counters.starts, counters.restarts, counters.faults) == (2, 1, 1)


@pytest.mark.timed
async def test_a_frozen_service_is_noticed_and_found_again(operator: Operator, socket: Path) -> None:
    with double_process(socket) as process:
        await in_contact(operator)
        await operator.switch(True)
        os.kill(process.pid, signal.SIGSTOP)
        try:
            frozen_s = time.monotonic()
            status = await until(operator, states.PREVIEW_FAULTED)
            noticed_s = time.monotonic() - frozen_s
        finally:
            os.kill(process.pid, signal.SIGCONT)
        # 3 s is the promise; the rest is for a busy test machine.
        assert noticed_s < 4
        assert "no report for 2.5 s" in status.preview.last_error
        status = await until(operator, states.PREVIEW_RUNNING)
        assert (status.preview.counters.starts, status.preview.counters.restarts) == (1, 0)


@pytest.mark.parametrize("requesting", [False, True], ids=["a silent stream", "an unanswered request"])
async def test_a_lost_connection_does_not_stay_open(
    operator: Operator, socket: Path, requesting: bool
) -> None:
    async def descriptors() -> int:
        return len(await asyncio.to_thread(os.listdir, descriptors_dir))

    with double_process(socket) as process:
        descriptors_dir = f"/proc/{process.pid}/fd"
        await in_contact(operator)
        before = await descriptors()
        gc.disable()  # It would close what was forgotten, some time.
        try:
            for enabled in (True, False):
                os.kill(process.pid, signal.SIGSTOP)
                if requesting:
                    await operator.switch(enabled)
                await eventually(operator.status, lambda it: not it.preview.service_reachable, "loss")
                os.kill(process.pid, signal.SIGCONT)
                await in_contact(operator)
            await eventually(descriptors, lambda count: count <= before, "one connection")
        finally:
            gc.enable()


async def test_a_request_while_the_service_is_frozen_is_answered_in_time(
    operator: Operator, socket: Path
) -> None:
    with double_process(socket) as process:
        await in_contact(operator)
        os.kill(process.pid, signal.SIGSTOP)
        try:
            reply = await operator.switch(True, timeout_s=6)
        finally:
            os.kill(process.pid, signal.SIGCONT)
        assert reply.accepted
        assert reply.preview.state == states.PREVIEW_FAULTED


async def test_a_service_that_refuses_is_quoted_and_not_asked_again(operator: Operator, socket: Path) -> None:
    double = PreviewDouble(Behaviour.REFUSES)
    server = await serve_double(socket, double)
    try:
        await in_contact(operator)
        reply = await operator.switch(True)
        assert reply.preview.state == states.PREVIEW_FAULTED
        assert "the double refuses" in reply.message
        off = await operator.switch(False)
        assert off.preview.state == states.PREVIEW_DISABLED
        assert [desired.enabled for desired in double.applied] == [True, False]
    finally:
        await server.stop(None)


async def test_a_service_of_another_version_is_reported_as_such(operator: Operator, socket: Path) -> None:
    with double_process(socket, Behaviour.REPORTS_AN_UNKNOWN_STATE):

        async def last_error() -> str:
            return str((await operator.switch(True)).preview.last_error)

        await eventually(last_error, lambda it: "state number 42" in it, "the unknown state is named")


async def test_an_unwanted_preview_is_off_whether_or_not_there_is_a_service(
    operator: Operator, socket: Path
) -> None:
    with double_process(socket):
        await in_contact(operator)
    status = await eventually(operator.status, lambda it: not it.preview.service_reachable, "loss noticed")
    assert status.preview.state == states.PREVIEW_DISABLED
    reply = await operator.switch(False)
    assert reply.accepted
    assert reply.preview.state == states.PREVIEW_DISABLED


async def test_a_restarted_gateway_leaves_the_video_alone(socket: Path) -> None:
    double = PreviewDouble()
    server = await serve_double(socket, double)
    try:
        async with running_gateway(socket) as operator:
            await in_contact(operator)
            await operator.switch(True, pb.PREVIEW_PROFILE_HIGH_QUALITY)
        async with running_gateway(socket) as operator:
            status = await until(operator, states.PREVIEW_RUNNING)
            assert status.preview.profile == pb.PREVIEW_PROFILE_HIGH_QUALITY
            reply = await operator.switch(True)
            assert "already running" in reply.message
        assert len(double.applied) == 1
    finally:
        await server.stop(None)


async def test_each_session_has_a_passphrase_that_callers_on_the_robot_see(socket: Path) -> None:
    double = PreviewDouble()
    server = await serve_double(socket, double)
    try:
        async with running_gateway(socket, preview={"encrypted": True}) as operator:
            await in_contact(operator)
            passphrases = []
            for profile in (pb.PREVIEW_PROFILE_LOW_BW, pb.PREVIEW_PROFILE_BALANCED):
                endpoint = (await operator.switch(True, profile)).preview.endpoint
                assert endpoint.encrypted
                assert endpoint.passphrase == double.applied[-1].passphrase
                assert 10 <= len(endpoint.passphrase) <= 79
                assert endpoint.passphrase not in endpoint.uri
                passphrases.append(endpoint.passphrase)
            await operator.switch(False)
            passphrases.append((await operator.switch(True)).preview.endpoint.passphrase)
            same, still, new = passphrases
            assert same == still != new
    finally:
        await server.stop(None)


class TestSwitching:
    """SetPreviewMode's answers, against a service that works unless the test says otherwise."""

    @pytest.fixture
    async def double(self, socket: Path, operator: Operator) -> AsyncIterator[PreviewDouble]:
        double = PreviewDouble()
        server = await serve_double(socket, double)
        try:
            await in_contact(operator)
            yield double
        finally:
            await server.stop(None)

    async def test_on_and_off(self, operator: Operator, double: PreviewDouble) -> None:
        on = await operator.switch(True)
        assert on.accepted
        assert on.message == "preview is running, balanced"
        assert on.preview.state == states.PREVIEW_RUNNING
        endpoint = on.preview.endpoint
        assert (endpoint.host, endpoint.port, endpoint.latency_ms) == ("127.0.0.1", 7100, 125)
        assert endpoint.uri == "srt://127.0.0.1:7100?mode=caller&latency=125"
        for _ in range(2):
            off = await operator.switch(False)
            assert off.accepted
            assert off.preview.state == states.PREVIEW_DISABLED
            assert off.preview.profile == pb.PREVIEW_PROFILE_BALANCED
        assert [desired.enabled for desired in double.applied] == [True, False]

    async def test_the_same_again_touches_nothing(self, operator: Operator, double: PreviewDouble) -> None:
        await operator.switch(True, pb.PREVIEW_PROFILE_HIGH_QUALITY)
        for profile in (pb.PREVIEW_PROFILE_HIGH_QUALITY, pb.PREVIEW_PROFILE_UNSPECIFIED):
            again = await operator.switch(True, profile)
            assert again.accepted
            assert "already running" in again.message
        assert len(double.applied) == 1

    @pytest.mark.usefixtures("double")
    async def test_an_unspecified_profile_is_the_last_chosen(self, operator: Operator) -> None:
        await operator.switch(True, pb.PREVIEW_PROFILE_LOW_BW)
        await operator.switch(False, pb.PREVIEW_PROFILE_HIGH_QUALITY)
        assert (await operator.switch(True)).preview.profile == pb.PREVIEW_PROFILE_LOW_BW

    async def test_a_profile_outside_the_enum_changes_nothing(
        self, operator: Operator, double: PreviewDouble
    ) -> None:
        await operator.switch(True, pb.PREVIEW_PROFILE_LOW_BW)
        with pytest.raises(grpc.aio.AioRpcError) as refused:
            await operator.switch(True, 77)
        assert refused.value.code() is grpc.StatusCode.INVALID_ARGUMENT
        assert "77" in str(refused.value.details())
        assert len(double.applied) == 1
        assert (await operator.status()).preview.profile == pb.PREVIEW_PROFILE_LOW_BW
        # Ignored where the contract says so.
        assert (await operator.switch(False, 77)).accepted

    async def test_a_pipeline_that_fails_is_no_rpc_error(
        self, operator: Operator, double: PreviewDouble
    ) -> None:
        double.behaviour = Behaviour.FAULTS
        reply = await operator.switch(True)
        assert reply.accepted
        assert reply.preview.state == states.PREVIEW_FAULTED
        assert reply.preview.last_error == "no camera found; plug one in"
        assert "plug one in" in reply.message
        # Asking again is worth an attempt.
        double.behaviour = Behaviour.WORKS
        assert (await operator.switch(True)).preview.state == states.PREVIEW_RUNNING

    async def test_a_slow_start_is_answered_before_the_callers_deadline(
        self, operator: Operator, double: PreviewDouble, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        # On a busy machine the answer takes longer than the 0.2 s that it has.
        monkeypatch.setattr("gateway.links.preview.control.DEADLINE_MARGIN_S", 3.0)
        double.behaviour = Behaviour.STAYS_STARTING
        # Sooner than the gateway loses patience by itself: preview.settle_ms, 4 s.
        reply = await operator.switch(True, timeout_s=3.5)
        assert reply.accepted
        assert reply.preview.state == states.PREVIEW_STARTING
        assert "not running yet" in reply.message

    async def test_the_newest_of_many_requests_wins_and_the_others_are_answered_so(
        self, operator: Operator, double: PreviewDouble
    ) -> None:
        double.behaviour = Behaviour.STAYS_STARTING
        older = asyncio.create_task(operator.switch(True, pb.PREVIEW_PROFILE_LOW_BW))
        await eventually(
            operator.status, lambda it: it.preview.state == states.PREVIEW_STARTING, "first request"
        )
        newer = await operator.switch(False)
        assert newer.preview.state == states.PREVIEW_DISABLED
        reply = await older
        assert reply.accepted
        assert "replaced by a newer request: preview off" in reply.message

    async def test_a_hundred_operators_at_once_end_in_one_agreed_state(
        self, operator: Operator, double: PreviewDouble
    ) -> None:
        profiles = [pb.PREVIEW_PROFILE_LOW_BW, pb.PREVIEW_PROFILE_BALANCED, pb.PREVIEW_PROFILE_HIGH_QUALITY]
        replies = await asyncio.gather(
            *(operator.switch(number % 4 != 0, profiles[number % 3]) for number in range(100))
        )
        assert all(reply.accepted for reply in replies)
        status = await operator.status()
        last = double.applied[-1]
        assert status.preview.state == (states.PREVIEW_RUNNING if last.enabled else states.PREVIEW_DISABLED)
        assert double.actual.applied_revision == last.revision

    @pytest.mark.usefixtures("double")
    async def test_events_show_what_happened_without_a_question(self, operator: Operator) -> None:
        await operator.switch(True)
        overlay = await eventually(
            operator.overlay,
            lambda it: any(event.message == "preview running, balanced" for event in it.events),
            "the event of the running preview",
        )
        sequences = [event.sequence for event in overlay.events]
        assert sequences == list(range(sequences[0], sequences[0] + len(sequences)))
        assert len(sequences) <= 8

    @pytest.mark.usefixtures("double")
    async def test_a_preview_that_was_on_for_a_moment_was_seen(self, operator: Operator) -> None:
        for _ in range(2):
            await operator.switch(True)
            await operator.switch(False)
        expected = ["preview running, balanced", "preview off"] * 2
        await eventually(
            operator.overlay,
            lambda it: [event.message for event in it.events][-4:] == expected,
            "an event for each of the four",
        )
