"""The supervisor with viewers, a recording, or both: the listener comes and goes beside the encoder."""

import asyncio
from pathlib import Path

import pytest

from common.errors import NotRunningError
from preview.config import TimeoutSettings
from preview.pipeline.events import AccessUnit, Blame, Fault
from preview.state.lifecycle import STEADY_AFTER_S, Counters, Reason, State
from preview.state.values import ActualState, DesiredState, Profile
from tests.support.pipeline_double import Script
from tests.support.supervised_preview import AGAIN, ON, PORT, SOURCE, Preview, now, row
from tests.support.virtual_time import in_virtual_time

ACCEPT = Fault(Blame.LISTENER, "the SRT listener on port 7100 failed: a caller could not be accepted.")


class Recording:
    """Counts what a recording gets."""

    def __init__(self) -> None:
        self.units: list[AccessUnit] = []
        self.interruptions = 0

    def take(self, unit: AccessUnit) -> None:
        self.units.append(unit)

    def interrupted(self) -> None:
        self.interruptions += 1


async def pipeline_is(preview: Preview, state: State) -> ActualState:
    return await preview.until(lambda actual: actual.pipeline_state is state)


@in_virtual_time
async def test_a_recording_alone_is_no_preview(tmp_path: Path) -> None:
    preview, recording = Preview(tmp_path), Recording()
    async with preview.serving():
        preview.supervisor.record(recording)
        state = await pipeline_is(preview, State.RUNNING)
        assert (state.state, state.reasons) == (State.DISABLED, (Reason.RECORDING,))
        assert (state.stream, state.encoder, state.measurement) == (None, None, None)
        (pipeline,) = preview.pipelines.built
        assert pipeline.plan.passphrase is None
        with pytest.raises(NotRunningError, match="the preview is disabled"):
            preview.supervisor.request_key_frame(None)
        await asyncio.sleep(100)
        assert recording.units
        preview.supervisor.record(None)
        state = await pipeline_is(preview, State.DISABLED)
        assert state.reasons == ()
    assert recording.interruptions == 0


@in_virtual_time
async def test_viewers_come_and_go_beside_a_recording(tmp_path: Path) -> None:
    preview, recording = Preview(tmp_path), Recording()
    async with preview.serving():
        preview.supervisor.record(recording)
        await pipeline_is(preview, State.RUNNING)
        changed = DesiredState(2, True, Profile.BALANCED, "battery staple")
        for desired in (ON, changed):
            assert preview.supervisor.apply(desired).state is State.STARTING
            state = await preview.reaches(State.RUNNING)
            assert state.reasons == (Reason.VIEWERS, Reason.RECORDING)
            assert state.stream
        assert preview.supervisor.apply(DesiredState(3, False)).state is State.STOPPING
        await preview.reaches(State.DISABLED)
        assert len(preview.pipelines.built) == 1
        assert recording.interruptions == 0


@in_virtual_time
async def test_a_recording_joins_and_leaves_a_preview(tmp_path: Path) -> None:
    preview, recording = Preview(tmp_path), Recording()
    async with preview.serving():
        preview.supervisor.apply(ON)
        await preview.reaches(State.RUNNING)
        preview.supervisor.record(recording)
        await asyncio.sleep(1)
        preview.supervisor.record(None)
        units = len(recording.units)
        assert units
        await asyncio.sleep(10)
        assert len(recording.units) == units
        assert preview.supervisor.actual().state is State.RUNNING
        assert len(preview.pipelines.built) == 1


@in_virtual_time
async def test_a_recording_goes_on_without_a_gateway(tmp_path: Path) -> None:
    timeouts = TimeoutSettings(without_gateway_s=5)
    preview, recording = Preview(tmp_path, timeouts=timeouts), Recording()
    running = asyncio.create_task(preview.supervisor.run(preview.stop))
    preview.supervisor.record(recording)
    preview.supervisor.apply(ON)
    await preview.reaches(State.RUNNING)
    state = await preview.reaches(State.DISABLED)
    assert now() == pytest.approx(5)
    assert (state.pipeline_state, state.reasons) == (State.RUNNING, (Reason.RECORDING,))
    preview.stop.set()
    await running


@in_virtual_time
async def test_a_pipeline_that_fails_is_retried_for_a_recording(tmp_path: Path) -> None:
    preview, recording = Preview(tmp_path, Script(fault=SOURCE, fault_after_s=5)), Recording()
    async with preview.serving():
        preview.supervisor.record(recording)
        faulted = await pipeline_is(preview, State.FAULTED)
        assert (faulted.state, faulted.last_error) == (State.DISABLED, SOURCE.text)
        await pipeline_is(preview, State.RUNNING)
        assert recording.interruptions == 1


@row("listener fails while running")
@in_virtual_time
async def test_a_listener_that_fails_is_opened_again_and_the_encoder_goes_on(tmp_path: Path) -> None:
    preview = Preview(tmp_path)
    async with preview.serving():
        preview.supervisor.apply(ON)
        await preview.reaches(State.RUNNING)
        await asyncio.sleep(STEADY_AFTER_S + 1)
        (pipeline,) = preview.pipelines.built
        failed_at = now()
        pipeline.lose_listener(ACCEPT)
        assert preview.supervisor.actual().pipeline_state is State.RUNNING
        state = await preview.until(
            lambda actual: actual.state is State.RUNNING and pipeline.listened[-1:] == [""]
        )
        assert now() - failed_at < 0.1, "at once, after a steady run"
        assert (state.last_error, state.counters) == (ACCEPT.text, Counters(starts=1))
        # The next one, so soon after it, waits.
        pipeline.lose_listener(ACCEPT)
        assert (await preview.reaches(State.FAULTED)).pipeline_state is State.RUNNING
        failed_at = now()
        await preview.reaches(State.RUNNING)
        assert now() - failed_at == pytest.approx(1.0, abs=0.1)
        assert not pipeline.stopped
    assert len(preview.pipelines.built) == 1


@row("listener fails again and again")
@in_virtual_time
async def test_a_listener_that_fails_again_and_again_fails_the_pipeline(tmp_path: Path) -> None:
    preview = Preview(tmp_path, Script(listener_faults=[ACCEPT] * 3))
    async with preview.serving():
        preview.supervisor.apply(ON)
        await preview.reaches(State.RUNNING)
        failed_at = now()
        preview.pipelines.built[0].lose_listener(ACCEPT)
        state = await preview.until(lambda actual: actual.pipeline_state is State.FAULTED)
        assert now() - failed_at == pytest.approx(1 + 2 + 4, abs=0.1)
        assert (state.last_error, state.counters.faults) == (ACCEPT.text, 1)
        await preview.reaches(State.RUNNING)
        first, _ = preview.pipelines.built
        assert first.stopped


@pytest.mark.parametrize("recording", [False, True])
@in_virtual_time
async def test_a_request_right_after_a_failure_leaves_no_listener_that_has_failed(
    tmp_path: Path, *, recording: bool
) -> None:
    """Before the supervisor has closed it, and although its passphrase is the right one."""
    preview = Preview(tmp_path)
    async with preview.serving():
        if recording:
            preview.supervisor.record(Recording())
        preview.supervisor.apply(ON)
        await preview.reaches(State.RUNNING)
        (pipeline,) = preview.pipelines.built
        opened = list(pipeline.listened)
        pipeline.lose_listener(ACCEPT)
        preview.supervisor.apply(AGAIN)
        await asyncio.sleep(100)
        assert pipeline.listened[len(opened) :] == [""]
        assert preview.supervisor.actual().state is State.RUNNING


@row("listener fails while recording")
@in_virtual_time
async def test_a_listener_that_fails_beside_a_recording(tmp_path: Path) -> None:
    preview, recording = Preview(tmp_path, Script(listener_faults=[PORT, PORT])), Recording()
    async with preview.serving():
        preview.supervisor.record(recording)
        await pipeline_is(preview, State.RUNNING)
        preview.supervisor.apply(ON)
        faulted = await preview.reaches(State.FAULTED)
        assert (faulted.pipeline_state, faulted.last_error) == (State.RUNNING, PORT.text)
        faulted_at = now()
        await preview.reaches(State.RUNNING)
        assert now() - faulted_at == pytest.approx(1 + 2, abs=0.1), "two retries, with backoff"
        (pipeline,) = preview.pipelines.built
        assert not pipeline.stopped
    assert recording.interruptions == 0


@in_virtual_time
async def test_a_new_request_tries_the_listener_at_once(tmp_path: Path) -> None:
    preview = Preview(tmp_path, Script(listener_faults=[PORT] * 6))
    async with preview.serving():
        preview.supervisor.record(Recording())
        await pipeline_is(preview, State.RUNNING)
        preview.supervisor.apply(ON)
        await asyncio.sleep(35)
        assert preview.supervisor.actual().state is State.FAULTED
        asked_at = now()
        preview.supervisor.apply(AGAIN)
        await preview.reaches(State.RUNNING)
        assert now() - asked_at < 2
