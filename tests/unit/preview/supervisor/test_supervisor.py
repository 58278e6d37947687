"""The supervisor: the rows of its failure table, and its requests."""

import asyncio
import re
from dataclasses import replace
from pathlib import Path

import pytest

from common.errors import NotRunningError
from preview.config import FileSource, TimeoutSettings
from preview.pipeline.events import Blame, Fault
from preview.state.lifecycle import STEADY_AFTER_S, Counters, State
from preview.state.values import DesiredState, Profile
from preview.supervisor import supervisor
from preview.supervisor.supervisor import ENCODER_STOP_S, GRAPH
from tests.support.pipeline_double import FIRST_FRAME_S, STOP_DEADLINE_S, Script
from tests.support.supervised_preview import (
    AGAIN,
    BLOCKED,
    NO_OUTPUT,
    OFF,
    ON,
    PORT,
    PROVEN,
    SOURCE,
    STALLED,
    Preview,
    now,
    prober,
    row,
)
from tests.support.virtual_time import in_virtual_time

ENCODER = Fault(Blame.ENCODER, "encoder mpp-h265 failed: hardware fault")
SILENT = Fault(Blame.ENCODER, "encoder mpp-h265 has produced no frame for 1.0 s")
STUCK = Fault(Blame.ENCODER, "encoder mpp-h265 hung when the profile was changed")


def test_every_row_of_the_failure_table_has_a_test() -> None:
    rows = [line.split("|")[1].strip() for line in str(supervisor.__doc__).splitlines() if line[:1] == "|"]
    assert rows[:2] == ["failure", "---"]
    siblings = Path(__file__).parent.glob("test_supervisor*.py")
    marks = (
        re.findall(r'^@row\("(.+)"\)$', each.read_text(encoding="utf-8"), re.MULTILINE) for each in siblings
    )
    assert set(rows[2:]) == {mark for each in marks for mark in each}


async def retried(preview: Preview, text: str) -> None:
    """The first attempt fails with `text`, the second one, a second later, works."""
    async with preview.serving():
        preview.supervisor.apply(ON)
        faulted = await preview.reaches(State.FAULTED)
        faulted_at = now()
        assert faulted.last_error == text
        running = await preview.reaches(State.RUNNING)
        assert now() - faulted_at == pytest.approx(1.0, abs=0.2)
        assert running.counters == Counters(starts=2, restarts=1, faults=1)
        assert running.encoder == preview.pipelines.built[-1].plan.choice
        assert running.encoder.fallback_reason == ""


async def replaced(preview: Preview, fault: Fault) -> None:
    """The first encoder fails, the second one takes over at once."""
    async with preview.serving():
        preview.supervisor.apply(ON)
        await preview.reaches(State.FAULTED)
        faulted_at = now()
        running = await preview.runs_with("va-h265")
        assert now() - faulted_at < ENCODER_STOP_S + 2 * FIRST_FRAME_S
        assert running.encoder
        assert (running.encoder.wanted, running.encoder.fallback_reason) == ("mpp-h265", fault.text)
        assert running.last_error == fault.text
        assert running.counters == Counters(starts=2, restarts=1, faults=1, fallbacks=1)


# --- the rows of the failure table ---


@row("no encoder works")
@in_virtual_time
async def test_without_an_encoder(tmp_path: Path) -> None:
    preview = Preview(tmp_path, trials=prober(x264=NO_OUTPUT), order=("x264",))
    async with preview.serving():
        preview.supervisor.apply(ON)
        state = await preview.until(lambda actual: actual.counters.faults == 2)
        assert "no encoder of x264 works (x264: it produced no output)" in state.last_error
        assert "'robot-preview encoders' lists what works" in state.last_error
        assert now() == pytest.approx(1.0)
        assert not preview.pipelines.built


@row("source unusable, element missing")
@in_virtual_time
async def test_a_pipeline_that_can_not_be_built(tmp_path: Path) -> None:
    await retried(Preview(tmp_path, Script(build_error="no element h265parse")), "no element h265parse")


@row("source unusable, element missing")
@in_virtual_time
async def test_a_source_that_appears_later(tmp_path: Path) -> None:
    film = tmp_path / "film.mkv"
    preview = Preview(tmp_path, source=FileSource(path=film))
    async with preview.serving():
        preview.supervisor.apply(ON)
        assert str(film) in (await preview.reaches(State.FAULTED)).last_error
        film.write_bytes(b"x")
        assert (await preview.reaches(State.RUNNING)).counters.restarts == 1


@row("port in use, address not local")
@in_virtual_time
async def test_a_port_in_use(tmp_path: Path) -> None:
    await retried(Preview(tmp_path, Script(fault=PORT)), PORT.text)


@row("source fails or ends")
@in_virtual_time
async def test_a_source_that_ends(tmp_path: Path) -> None:
    preview = Preview(tmp_path, Script(fault=SOURCE, fault_after_s=5))
    await retried(preview, SOURCE.text)
    assert (tmp_path / GRAPH).read_text(encoding="utf-8").startswith("digraph")
    assert all(pipeline.stopped for pipeline in preview.pipelines.built)


@row("source stalls")
@in_virtual_time
async def test_a_source_that_stalls(tmp_path: Path) -> None:
    await retried(Preview(tmp_path, Script(fault=STALLED, fault_after_s=5)), STALLED.text)


@row("encoder can't be opened or fails")
@pytest.mark.parametrize("after_s", [0, 5])
@in_virtual_time
async def test_an_encoder_that_fails(tmp_path: Path, after_s: float) -> None:
    await replaced(Preview(tmp_path, Script(fault=ENCODER, fault_after_s=after_s)), ENCODER)


@row("encoder is silent, or gives empty buffers")
@pytest.mark.parametrize("after_s", [0, 5])
@in_virtual_time
async def test_a_silent_encoder(tmp_path: Path, after_s: float) -> None:
    await replaced(Preview(tmp_path, Script(fault=SILENT, fault_after_s=after_s)), SILENT)


@row("source's or listener's driver blocks a start")
@in_virtual_time
async def test_a_camera_that_blocks_the_start(tmp_path: Path) -> None:
    await retried(Preview(tmp_path, Script(fault=BLOCKED)), BLOCKED.text)


@row("encoder's driver blocks a start or an adjustment")
@in_virtual_time
async def test_a_driver_that_blocks_a_profile_change(tmp_path: Path) -> None:
    preview = Preview(tmp_path, Script(fault_in_switch=STUCK))
    async with preview.serving():
        preview.supervisor.apply(ON)
        await preview.runs_with("mpp-h265")
        preview.supervisor.apply(DesiredState(2, True, Profile.LOW_BW))
        state = await preview.runs_with("va-h265")
        assert state.profile is Profile.LOW_BW
        assert state.encoder
        assert state.encoder.fallback_reason == STUCK.text


@row("last proven encoder fails")
@in_virtual_time
async def test_without_an_alternative_the_encoder_is_tried_again(tmp_path: Path) -> None:
    await retried(
        Preview(tmp_path, Script(fault=ENCODER, fault_after_s=1), order=("mpp-h265",)), ENCODER.text
    )


@row("pipeline fails again after running steadily")
@in_virtual_time
async def test_the_backoff_starts_again_after_a_steady_run(tmp_path: Path) -> None:
    soon, late = Script(fault=SOURCE, fault_after_s=1), Script(fault=SOURCE, fault_after_s=STEADY_AFTER_S + 1)
    preview = Preview(tmp_path, soon, soon, soon, late, soon)
    delays_s = []
    async with preview.serving():
        preview.supervisor.apply(ON)
        for count in range(1, 6):
            await preview.until(lambda actual, count=count: actual.counters.faults == count)  # type: ignore[misc]
            faulted_at = now()
            await preview.reaches(State.STARTING)
            delays_s.append(round(now() - faulted_at))
    assert delays_s == [1, 2, 4, 1, 2]


@row("pipeline fails while it is being stopped")
@in_virtual_time
async def test_a_fault_of_the_teardown_is_ignored(tmp_path: Path) -> None:
    preview = Preview(tmp_path, Script(fault_in_stop=ENCODER))
    async with preview.serving():
        preview.supervisor.apply(ON)
        await preview.reaches(State.RUNNING)
        preview.supervisor.apply(OFF)
        assert preview.supervisor.actual().state is State.STOPPING
        state = await preview.reaches(State.DISABLED)
        assert (state.last_error, state.counters) == ("", Counters(starts=1))


@row("encoder hangs after a fault")
@in_virtual_time
async def test_an_encoder_that_hangs_is_left_behind(tmp_path: Path) -> None:
    preview = Preview(tmp_path, Script(fault=SILENT, encoder_hangs=True))
    async with preview.serving(dies_of="encoder mpp-h265 hung when it was stopped"):
        preview.supervisor.apply(ON)
        await preview.reaches(State.FAULTED)
        faulted_at = now()
        await preview.runs_with("va-h265")
        assert now() - faulted_at == pytest.approx(ENCODER_STOP_S + FIRST_FRAME_S, abs=0.05)
        # The process goes on, also with another session, until the preview is disabled.
        await asyncio.sleep(10 * STOP_DEADLINE_S)
        preview.supervisor.apply(DesiredState(5, True, Profile.BALANCED, "another session"))
        await preview.runs_with("va-h265")
        assert len(preview.pipelines.built) == 3
        preview.supervisor.apply(OFF)
    assert (preview.marker.encoder, preview.marker.reason) == ("mpp-h265", "it hung when it was stopped")


@row("encoder hangs after a fault")
@pytest.mark.parametrize("disabled_after_s", [0.1, 10])
@in_virtual_time
async def test_an_encoder_that_hangs_is_freed_when_disabled_while_faulted(
    tmp_path: Path, disabled_after_s: float
) -> None:
    """No encoder takes over here: disabling finds no pipeline, but a driver that is still occupied."""
    scripts = [Script(fault=SILENT, encoder_hangs=True), *[Script(build_error="no camera")] * 9]
    preview = Preview(tmp_path, *scripts, order=("mpp-h265",))
    async with preview.serving(dies_of="encoder mpp-h265 hung when it was stopped"):
        preview.supervisor.apply(ON)
        await preview.reaches(State.FAULTED)
        await asyncio.sleep(disabled_after_s)
        assert preview.supervisor.actual().state is State.FAULTED
        preview.supervisor.apply(OFF)
    assert (preview.marker.encoder, preview.marker.reason) == ("mpp-h265", "it hung when it was stopped")


@row("encoder hangs after a fault")
@in_virtual_time
async def test_an_encoder_that_is_slow_to_stop_is_no_reason_to_end(tmp_path: Path) -> None:
    preview = Preview(tmp_path, Script(fault=SILENT, stop_s=2))
    async with preview.serving():
        preview.supervisor.apply(ON)
        await preview.runs_with("va-h265")
        assert preview.marker.encoder == "va-h265"
        assert preview.marker.proven == ["va-h265"], "the one that failed has to prove itself again"
        preview.supervisor.apply(OFF)
        await preview.reaches(State.DISABLED)
        assert now() == pytest.approx(2 + FIRST_FRAME_S, abs=0.1), (
            "disabled when the slow encoder has stopped"
        )
        assert preview.marker.encoder == "", "a later crash is not this encoder's"


@row("encoder hangs when the preview is disabled")
@in_virtual_time
async def test_an_encoder_that_hangs_at_the_end(tmp_path: Path) -> None:
    preview = Preview(tmp_path, Script(encoder_hangs=True))
    async with preview.serving(dies_of="encoder mpp-h265 hung when it was stopped"):
        preview.supervisor.apply(ON)
        await preview.reaches(State.RUNNING)
        preview.supervisor.apply(OFF)
    assert (preview.marker.encoder, preview.marker.reason) == ("mpp-h265", "it hung when it was stopped")


@row("source or listener hangs when stopped")
@pytest.mark.parametrize("fault", [None, SOURCE])
@in_virtual_time
async def test_a_listener_that_hangs(tmp_path: Path, fault: Fault | None) -> None:
    preview = Preview(tmp_path, Script(fault=fault, fault_after_s=1, listener_hangs=True))
    async with preview.serving(dies_of="the SRT listener hung when it was stopped"):
        preview.supervisor.apply(ON)
        await preview.reaches(State.RUNNING)
        if fault is None:
            preview.supervisor.apply(OFF)
    assert preview.marker.reason == "", "no encoder is blamed"


@row("driver crashes the process")
@in_virtual_time
async def test_the_crash_marker_names_the_encoder_as_long_as_it_is_in_use(tmp_path: Path) -> None:
    preview = Preview(tmp_path, Script(fault=ENCODER, fault_after_s=1))
    async with preview.serving():
        preview.supervisor.apply(ON)
        await preview.runs_with("mpp-h265")
        assert (preview.marker.encoder, preview.marker.reason) == ("mpp-h265", "")
        await preview.runs_with("va-h265")
        assert preview.marker.encoder == "va-h265"
        preview.supervisor.apply(OFF)
        await preview.reaches(State.DISABLED)
        assert preview.marker.encoder == ""
    # The next process reads the marker (test_crash_marker.py) and passes that encoder over.
    following = Preview(tmp_path)
    following.selection.pass_over("mpp-h265", "encoder mpp-h265 is passed over: the process crashed")
    async with following.serving():
        following.supervisor.apply(ON)
        await following.runs_with("va-h265")


@row("hardware preferred, only x264 works")
@in_virtual_time
async def test_software_for_hardware(tmp_path: Path) -> None:
    preview = Preview(tmp_path, trials=prober(mpp_h265=NO_OUTPUT, va_h265=NO_OUTPUT))
    async with preview.serving():
        preview.supervisor.apply(ON)
        state = await preview.runs_with("x264")
        assert state.last_error == (
            "no hardware encoder works, so the CPU encodes with x264: it produced no output"
        )
        assert state.counters == Counters(starts=1)


@row("more viewers than srt.max_viewers")
@in_virtual_time
async def test_refused_viewers_are_counted_over_pipelines(tmp_path: Path) -> None:
    refusing = Script(viewers_refused=2, fault=SOURCE, fault_after_s=0.6)
    preview = Preview(tmp_path, refusing, replace(refusing, viewers_refused=1))
    async with preview.serving():
        preview.supervisor.apply(ON)
        await preview.until(lambda actual: actual.counters.faults == 2)
        assert preview.supervisor.actual().counters.viewers_refused == 3


@row("gateway is gone")
@in_virtual_time
async def test_unwatched_it_stops_and_the_same_revision_enables_it_again(tmp_path: Path) -> None:
    preview = Preview(tmp_path, timeouts=TimeoutSettings(without_gateway_s=20))
    running = asyncio.create_task(preview.supervisor.run(preview.stop))
    with preview.supervisor.watched():
        preview.supervisor.apply(ON)
        await asyncio.sleep(100)
        assert preview.supervisor.actual().state is State.RUNNING
    await asyncio.sleep(15)
    preview.supervisor.apply(ON)  # A gateway that only applies postpones it, too.
    await asyncio.sleep(15)
    assert preview.supervisor.actual().state is State.RUNNING
    state = await preview.reaches(State.DISABLED)
    assert now() == pytest.approx(135, abs=1)
    assert state.last_error == "the preview stopped by itself: no gateway has watched it for 20 s"
    assert (state.applied_revision, state.profile) == (0, Profile.BALANCED)
    preview.supervisor.apply(ON)
    assert (await preview.reaches(State.RUNNING)).last_error == ""
    with preview.supervisor.watched():
        await asyncio.sleep(100)
        left_at = now()
    await preview.reaches(State.DISABLED)
    assert now() - left_at == pytest.approx(20, abs=1)
    preview.stop.set()
    await running


# --- requests ---


@in_virtual_time
async def test_enable_and_disable(tmp_path: Path) -> None:
    preview = Preview(tmp_path)
    async with preview.serving():
        before = preview.supervisor.actual()
        assert (before.state, before.applied_revision, before.stream) == (State.DISABLED, 0, None)
        answer = preview.supervisor.apply(ON)
        assert (answer.state, answer.applied_revision, answer.stream) == (State.STARTING, 1, None)
        state = await preview.until(lambda actual: actual.measurement is not None)
        assert (state.state, state.profile) == (State.RUNNING, Profile.BALANCED)
        assert state.stream == preview.pipelines.built[0].stream
        preview.supervisor.apply(OFF)
        after = await preview.reaches(State.DISABLED)
        assert (after.applied_revision, after.profile, after.stream) == (2, Profile.BALANCED, None)
        assert after.counters == Counters(starts=1)
        assert preview.pipelines.built[0].stopped


@in_virtual_time
async def test_the_same_revision_changes_nothing(tmp_path: Path) -> None:
    preview = Preview(tmp_path)
    async with preview.serving():
        preview.supervisor.apply(ON)
        await preview.reaches(State.RUNNING)
        assert preview.supervisor.apply(ON).state is State.RUNNING
        assert preview.supervisor.apply(DesiredState(ON.revision, False)).state is State.RUNNING
        await asyncio.sleep(10)
        assert len(preview.pipelines.built) == 1


@in_virtual_time
async def test_enabled_again_while_it_stops(tmp_path: Path) -> None:
    preview = Preview(tmp_path)
    async with preview.serving():
        preview.supervisor.apply(ON)
        await preview.reaches(State.RUNNING)
        preview.supervisor.apply(OFF)
        assert preview.supervisor.apply(AGAIN).state is State.STOPPING
        state = await preview.reaches(State.RUNNING)
        assert (state.applied_revision, state.counters) == (3, Counters(starts=2))


@in_virtual_time
async def test_disabled_during_the_trials_nothing_is_built(tmp_path: Path) -> None:
    preview = Preview(tmp_path, trials=prober(trial_s=2))
    async with preview.serving():
        preview.supervisor.apply(ON)
        await asyncio.sleep(1)
        preview.supervisor.apply(OFF)
        await preview.reaches(State.DISABLED)
        assert now() == pytest.approx(1)
        await asyncio.sleep(10)
        assert not preview.pipelines.built


@pytest.mark.parametrize("request_", [AGAIN, OFF], ids=["on", "off"])
@in_virtual_time
async def test_a_request_during_the_trials_after_a_fault(tmp_path: Path, request_: DesiredState) -> None:
    preview = Preview(tmp_path, Script(fault=ENCODER, fault_after_s=5), trials=prober(trial_s=2))
    async with preview.serving():
        preview.supervisor.apply(ON)
        await preview.reaches(State.FAULTED)
        # The failed pipeline is torn down, and the trial of the next encoder runs.
        await asyncio.sleep(1)
        preview.supervisor.apply(request_)
        await (preview.runs_with("va-h265") if request_.enabled else preview.reaches(State.DISABLED))


@in_virtual_time
async def test_another_profile_keeps_the_pipeline(tmp_path: Path) -> None:
    preview = Preview(tmp_path)
    async with preview.serving():
        preview.supervisor.apply(ON)
        await preview.reaches(State.RUNNING)
        # A gateway takes the new revision as applied: the old profile must not be beside it.
        answer = preview.supervisor.apply(DesiredState(2, True, Profile.LOW_BW))
        assert (answer.applied_revision, answer.profile) == (2, Profile.LOW_BW)
        state = await preview.until(
            lambda actual: actual.stream is not None and actual.stream.target.fps == 15
        )
        assert state.stream
        assert (state.state, state.stream.target.fps) == (State.RUNNING, 15)
        assert len(preview.pipelines.built) == 1


@in_virtual_time
async def test_another_passphrase_rebuilds_the_pipeline(tmp_path: Path) -> None:
    preview = Preview(tmp_path, Script(build_error="no camera"))
    async with preview.serving():
        preview.supervisor.apply(DesiredState(1, True, Profile.BALANCED, "correct horse"))
        assert (await preview.reaches(State.RUNNING)).last_error == "no camera"
        changed = DesiredState(2, True, Profile.BALANCED, "battery staple")
        assert preview.supervisor.apply(changed).state is State.STOPPING
        assert (await preview.reaches(State.RUNNING)).last_error == "", "a new session"
        old, new = preview.pipelines.built
        assert old.stopped
        assert new.plan.passphrase == "battery staple"


@pytest.mark.parametrize("order", [("mpp-h265", "va-h265"), ("mpp-h265",)])
@in_virtual_time
async def test_a_new_request_retries_at_once(tmp_path: Path, order: tuple[str, ...]) -> None:
    faults = [Script(fault=SOURCE)] * 5
    preview = Preview(tmp_path, *faults, order=order)
    async with preview.serving():
        preview.supervisor.apply(ON)
        await preview.until(lambda actual: actual.counters.faults == 5)
        faulted_at = now()
        await asyncio.sleep(1)
        assert preview.supervisor.apply(AGAIN).state is State.STARTING
        await preview.reaches(State.RUNNING)
        assert now() - faulted_at == pytest.approx(1 + FIRST_FRAME_S, abs=0.1)
        await asyncio.sleep(100)  # The retry that was scheduled is cancelled.


@in_virtual_time
async def test_a_new_request_during_the_teardown_retries_right_after_it(tmp_path: Path) -> None:
    preview = Preview(tmp_path, Script(fault=SOURCE, stop_s=0.2))
    async with preview.serving():
        preview.supervisor.apply(ON)
        await preview.reaches(State.FAULTED)
        faulted_at = now()
        assert preview.supervisor.apply(AGAIN).state is State.FAULTED
        state = await preview.reaches(State.RUNNING)
        assert now() - faulted_at == pytest.approx(0.2 + FIRST_FRAME_S, abs=0.1)
        assert (state.applied_revision, state.counters.restarts) == (3, 1)


@in_virtual_time
async def test_disabled_while_faulted(tmp_path: Path) -> None:
    preview = Preview(tmp_path, Script(fault=SOURCE, stop_s=1))
    async with preview.serving():
        preview.supervisor.apply(ON)
        await preview.reaches(State.FAULTED)
        preview.supervisor.apply(OFF)
        state = await preview.reaches(State.DISABLED)
        assert state.last_error == SOURCE.text
        await asyncio.sleep(100)
        assert len(preview.pipelines.built) == 1


@in_virtual_time
async def test_a_request_for_a_retry_does_not_outlive_a_disable(tmp_path: Path) -> None:
    preview = Preview(tmp_path, Script(fault=SOURCE), Script(fault=SOURCE))
    async with preview.serving():
        preview.supervisor.apply(ON)
        await preview.reaches(State.FAULTED)
        preview.supervisor.apply(AGAIN)
        preview.supervisor.apply(DesiredState(4, False))
        await preview.reaches(State.DISABLED)
        preview.supervisor.apply(DesiredState(5, True))
        await preview.until(lambda actual: actual.counters.faults == 2)
        faulted_at = now()
        await preview.reaches(State.STARTING)
        assert now() - faulted_at == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("after_s", [0.5, 1.5])
@in_virtual_time
async def test_a_stop_does_not_wait_for_trials(tmp_path: Path, after_s: float) -> None:
    """Neither for those of a start, nor for those after a fault."""
    preview = Preview(tmp_path, Script(fault=ENCODER), trials=prober(trial_s=1, mpp_h265=PROVEN))
    async with preview.serving():
        preview.supervisor.apply(ON)
        await asyncio.sleep(after_s)
        stopped_at = now()
    assert now() - stopped_at < 0.1
    assert preview.supervisor.apply(AGAIN).state is State.DISABLED, "nothing is started any more"
    assert preview.supervisor.actual().state is State.DISABLED


@in_virtual_time
async def test_at_the_end_no_pipeline_is_left(tmp_path: Path) -> None:
    preview = Preview(tmp_path)
    async with preview.serving():
        preview.supervisor.apply(ON)
        await preview.reaches(State.RUNNING)
    assert preview.pipelines.built[0].stopped
    assert preview.supervisor.actual().state is State.DISABLED
    assert preview.marker.encoder == ""


@in_virtual_time
async def test_viewers_requests_reach_the_running_pipeline(tmp_path: Path) -> None:
    preview = Preview(tmp_path)
    async with preview.serving():
        with pytest.raises(NotRunningError, match="the preview is disabled"):
            preview.supervisor.request_key_frame(None)
        preview.supervisor.take_picture_age(140)
        preview.supervisor.apply(ON)
        with pytest.raises(NotRunningError, match="the preview is starting"):
            preview.supervisor.request_key_frame(None)
        await preview.reaches(State.RUNNING)
        assert preview.supervisor.request_key_frame(7)
        assert not preview.supervisor.request_key_frame(None)
        preview.supervisor.take_picture_age(160)
        (pipeline,) = preview.pipelines.built
        assert pipeline.key_frames_requested == [7, None]
        assert pipeline.picture_ages_ms == [160]
        preview.supervisor.apply(OFF)
        with pytest.raises(NotRunningError, match="the preview is stopping"):
            preview.supervisor.request_key_frame(None)
