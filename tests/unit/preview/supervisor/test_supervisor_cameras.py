"""The supervisor and its cameras: what is live, what follows when one fails, and what operators choose."""

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest

from common.errors import InvalidRequestError
from preview.config import FileSource, TestSource
from preview.pipeline.events import Blame, Fault
from preview.state.cameras import CameraState
from preview.state.lifecycle import Counters, State
from preview.state.values import ActualState, DesiredState, Profile
from tests.support.pipeline_double import FIRST_FRAME_S, SHOW_S, Script
from tests.support.supervised_preview import BLOCKED, LOOK_S, OFF, SOURCE, STALLED, Preview, now, row
from tests.support.virtual_time import in_virtual_time

ROBOT = {
    "front": TestSource(fallback="rear"),
    "rear": TestSource(pattern="ball"),
    "arm": TestSource(pattern="snow"),
}
FRONT = DesiredState(1, True, camera="front")
REAR = DesiredState(2, True, camera="rear")
ARM = DesiredState(3, True, camera="arm")
REAR_BROKEN = Fault(Blame.SOURCE, "camera rear (test pattern) has ended.")
ARM_BROKEN = Fault(Blame.SOURCE, "camera arm (test pattern) failed: no bandwidth.")


def cameras_of(actual: ActualState) -> dict[str, CameraState]:
    return {camera.name: camera.state for camera in actual.cameras}


async def is_live(preview: Preview, camera: str) -> ActualState:
    return await preview.until(
        lambda actual: actual.state is State.RUNNING and cameras_of(actual)[camera] is CameraState.LIVE
    )


async def front_is_lost(preview: Preview) -> float:
    """Shows front until its fallback is being started in its place; returns when that was."""
    preview.supervisor.apply(FRONT)
    await is_live(preview, "front")
    await preview.until(lambda it: cameras_of(it)["rear"] is CameraState.STARTING)
    return now()


@row("a look at a source hangs")
@in_virtual_time
async def test_a_first_camera_that_does_not_answer_is_replaced(tmp_path: Path) -> None:
    preview = Preview(tmp_path, cameras=ROBOT)
    preview.hung.add("front")
    async with preview.serving():
        preview.supervisor.apply(FRONT)
        actual = await is_live(preview, "rear")
        assert now() == pytest.approx(LOOK_S, abs=3 * FIRST_FRAME_S)
        assert actual.last_error == "camera front does not answer"
        # It is tried again, beside its fallback.
        await preview.until(lambda it: cameras_of(it)["front"] is CameraState.STARTING)
        await preview.until(lambda it: cameras_of(it)["front"] is CameraState.FAILED)
        assert cameras_of(preview.supervisor.actual())["rear"] is CameraState.LIVE
        preview.hung.clear()
        await is_live(preview, "front")
        assert len(preview.pipelines.built) == 1


@row("a look at a source hangs")
@in_virtual_time
async def test_a_fallback_that_does_not_answer_is_given_up_for_the_camera_itself(tmp_path: Path) -> None:
    preview = Preview(tmp_path, Script(fault=SOURCE, fault_after_s=5), cameras=ROBOT)
    preview.hung.add("rear")
    async with preview.serving():
        lost_at = await front_is_lost(preview)
        actual = await is_live(preview, "front")
        assert now() - lost_at == pytest.approx(LOOK_S + SHOW_S)
        assert actual.counters == Counters(starts=1)
        assert actual.cameras[1].error == "camera rear does not answer"


@row("no fallback, or none that works")
@in_virtual_time
async def test_a_fallback_that_is_missing_ends_the_pipeline(tmp_path: Path) -> None:
    cameras = {**ROBOT, "rear": FileSource(path=tmp_path / "film.mkv")}
    preview = Preview(tmp_path, Script(fault=SOURCE, fault_after_s=5), cameras=cameras)
    async with preview.serving():
        preview.supervisor.apply(FRONT)
        await is_live(preview, "front")
        faulted = await preview.reaches(State.FAULTED)
        assert now() == pytest.approx(5 + FIRST_FRAME_S, abs=0.01)
        assert faulted.last_error == SOURCE.text
        assert "film.mkv" in faulted.cameras[1].error
        await is_live(preview, "front")


@row("a look at a source hangs")
@in_virtual_time
async def test_while_a_camera_does_not_answer_requests_count(tmp_path: Path) -> None:
    preview = Preview(tmp_path, cameras=ROBOT)
    preview.hung |= {"front", "arm"}
    async with preview.serving():
        preview.supervisor.apply(FRONT)
        await asyncio.sleep(1)
        preview.supervisor.apply(replace(OFF, revision=2))
        await preview.until(lambda it: it.pipeline_state is State.DISABLED)
        assert now() == pytest.approx(1), "the look was given up"
        assert not preview.pipelines.built
        preview.supervisor.apply(replace(REAR, revision=3))
        await is_live(preview, "rear")
        preview.supervisor.apply(replace(ARM, revision=4))
        assert cameras_of(preview.supervisor.actual())["arm"] is CameraState.STARTING
        await asyncio.sleep(1)
        preview.hung.clear()
        preview.supervisor.apply(replace(FRONT, revision=5))
        await is_live(preview, "front")
        await asyncio.sleep(2 * LOOK_S)
        actual = preview.supervisor.actual()
        assert cameras_of(actual)["front"] is CameraState.LIVE
        assert cameras_of(actual)["arm"] is CameraState.READY, "the look was given up"


@row("a look at a source hangs")
@in_virtual_time
async def test_instead_of_a_first_camera_that_does_not_answer_another_is_started_at_once(
    tmp_path: Path,
) -> None:
    preview = Preview(tmp_path, cameras=ROBOT)
    preview.hung.add("front")
    async with preview.serving():
        preview.supervisor.apply(FRONT)
        await asyncio.sleep(1)
        preview.supervisor.apply(REAR)
        actual = await is_live(preview, "rear")
        assert now() == pytest.approx(1 + FIRST_FRAME_S)
        assert (actual.last_error, actual.counters) == ("", Counters(starts=1))


@row("a look at a source hangs")
@in_virtual_time
async def test_requests_for_the_same_camera_do_not_prolong_the_look_at_it(tmp_path: Path) -> None:
    preview = Preview(tmp_path, cameras=ROBOT)
    preview.hung.add("front")
    async with preview.serving():
        preview.supervisor.apply(FRONT)
        await asyncio.sleep(LOOK_S - 1)
        preview.supervisor.apply(DesiredState(2, True, Profile.LOW_BW, camera="front"))
        await is_live(preview, "rear")
        assert now() == pytest.approx(LOOK_S, abs=3 * FIRST_FRAME_S)


@row("a look at a source hangs")
@in_virtual_time
async def test_a_stop_does_not_wait_for_a_look(tmp_path: Path) -> None:
    preview = Preview(tmp_path, cameras=ROBOT)
    preview.hung.add("front")
    async with preview.serving():
        preview.supervisor.apply(FRONT)
        await asyncio.sleep(1)
    assert now() == pytest.approx(1)
    assert preview.supervisor.actual().state is State.DISABLED


@row("a look at a source hangs")
@in_virtual_time
async def test_a_camera_that_was_given_up_does_not_take_over_during_the_look_at_another(
    tmp_path: Path,
) -> None:
    preview = Preview(tmp_path, cameras=ROBOT)
    preview.hung.add("rear")
    async with preview.serving():
        preview.supervisor.apply(FRONT)
        await is_live(preview, "front")
        preview.supervisor.apply(ARM)
        await asyncio.sleep(SHOW_S / 2)
        assert preview.pipelines.built[0].starting_camera == "arm"
        preview.supervisor.apply(replace(REAR, revision=4))
        await asyncio.sleep(2 * SHOW_S)
        assert cameras_of(preview.supervisor.actual()) == {
            "front": CameraState.LIVE,
            "rear": CameraState.STARTING,
            "arm": CameraState.READY,
        }
        actual = await preview.until(lambda it: cameras_of(it)["rear"] is CameraState.FAILED)
        assert cameras_of(actual)["front"] is CameraState.LIVE


@row("a look at a source hangs")
@in_virtual_time
async def test_a_fallback_on_its_way_goes_on_when_it_is_chosen_again(tmp_path: Path) -> None:
    """Also during the look at another: with the live camera lost, it is the next one to deliver."""
    preview = Preview(tmp_path, Script(fault=SOURCE, fault_after_s=5), cameras=ROBOT)
    preview.hung.add("arm")
    async with preview.serving():
        lost_at = await front_is_lost(preview)
        await asyncio.sleep(SHOW_S / 4)
        preview.supervisor.apply(replace(ARM, revision=4))
        await asyncio.sleep(SHOW_S / 4)
        assert preview.pipelines.built[0].starting_camera == "rear"
        preview.supervisor.apply(replace(REAR, revision=5))
        await is_live(preview, "rear")
        assert now() - lost_at == pytest.approx(SHOW_S), "it was not started anew"


@in_virtual_time
async def test_a_camera_that_takes_over_during_a_look_at_it_is_not_started_again(tmp_path: Path) -> None:
    """It was given up too late, when it was about to take over, and chosen again."""
    preview = Preview(tmp_path, cameras=ROBOT)
    preview.hung.add("arm")
    async with preview.serving():
        preview.supervisor.apply(FRONT)
        await is_live(preview, "front")
        preview.supervisor.apply(ARM)
        await asyncio.sleep(1)
        pipeline = preview.pipelines.built[0]
        pipeline.plan = replace(pipeline.plan, source=replace(pipeline.plan.source, camera="arm"))
        preview.supervisor.camera_shown("arm")
        await asyncio.sleep(2 * LOOK_S)
        actual = preview.supervisor.actual()
        assert (cameras_of(actual)["arm"], actual.last_error) == (CameraState.LIVE, "")


@row("source fails or ends")
@row("source stalls")
@pytest.mark.parametrize("fault", [SOURCE, STALLED])
@in_virtual_time
async def test_the_fallback_takes_the_place_of_a_camera_in_the_running_pipeline(
    tmp_path: Path, fault: Fault
) -> None:
    preview = Preview(tmp_path, Script(fault=fault, fault_after_s=5), cameras=ROBOT)
    async with preview.serving():
        preview.supervisor.apply(FRONT)
        await is_live(preview, "front")
        actual = await is_live(preview, "rear")
        assert now() == pytest.approx(5 + FIRST_FRAME_S + SHOW_S, abs=0.01)
        assert (actual.wanted_camera, actual.last_error) == ("front", fault.text)
        assert actual.counters == Counters(starts=1)
        front = actual.cameras[0]
        assert (front.state, front.error, front.fallback) == (CameraState.FAILED, fault.text, "rear")
        # Which gives its place back when that delivers again.
        actual = await is_live(preview, "front")
        assert now() == pytest.approx(6 + FIRST_FRAME_S + SHOW_S, abs=0.01)
        assert cameras_of(actual)["rear"] is CameraState.READY
        assert actual.counters == Counters(starts=1)
    assert len(preview.pipelines.built) == 1


@row("no fallback, or none that works")
@in_virtual_time
async def test_without_a_fallback_that_works_the_preview_is_faulted(tmp_path: Path) -> None:
    script = Script(fault=SOURCE, fault_after_s=5, camera_faults={"rear": REAR_BROKEN})
    preview = Preview(tmp_path, script, cameras=ROBOT)
    async with preview.serving():
        preview.supervisor.apply(FRONT)
        await is_live(preview, "front")
        faulted = await preview.reaches(State.FAULTED)
        assert faulted.last_error == SOURCE.text
        assert {each.name: each.error for each in faulted.cameras} == {
            "front": SOURCE.text,
            "rear": REAR_BROKEN.text,
            "arm": "",
        }
        await is_live(preview, "front")
        assert preview.supervisor.actual().counters == Counters(starts=2, restarts=1, faults=1)


@row("no fallback, or none that works")
@in_virtual_time
async def test_a_camera_without_a_fallback_is_waited_for(tmp_path: Path) -> None:
    preview = Preview(tmp_path, Script(fault=SOURCE, fault_after_s=5), cameras=ROBOT)
    async with preview.serving():
        preview.supervisor.apply(ARM)
        await is_live(preview, "arm")
        await preview.reaches(State.FAULTED)
        await is_live(preview, "arm")


@row("source fails or ends")
@in_virtual_time
async def test_a_camera_that_does_not_even_start_is_replaced_at_once(tmp_path: Path) -> None:
    preview = Preview(tmp_path, Script(fault=BLOCKED), cameras=ROBOT)
    async with preview.serving():
        preview.supervisor.apply(FRONT)
        await is_live(preview, "rear")
        assert now() < 3 * FIRST_FRAME_S
        await is_live(preview, "front")
        assert len(preview.pipelines.built) == 2


@row("a camera to switch to fails")
@in_virtual_time
async def test_the_live_camera_stays_while_the_wanted_one_fails(tmp_path: Path) -> None:
    script = Script(camera_faults={"arm": ARM_BROKEN})
    preview = Preview(tmp_path, script, cameras=ROBOT)
    async with preview.serving():
        preview.supervisor.apply(FRONT)
        await is_live(preview, "front")
        assert cameras_of(preview.supervisor.apply(ARM))["arm"] is CameraState.STARTING
        actual = await preview.until(lambda it: cameras_of(it)["arm"] is CameraState.FAILED)
        assert (actual.state, actual.wanted_camera, actual.last_error) == (
            State.RUNNING,
            "arm",
            ARM_BROKEN.text,
        )
        assert cameras_of(actual)["front"] is CameraState.LIVE
        await asyncio.sleep(2)
        del script.camera_faults["arm"]
        await is_live(preview, "arm")
        assert now() == pytest.approx(3, abs=0.3)
        assert preview.supervisor.actual().counters == Counters(starts=1)


@row("a camera to switch to fails")
@in_virtual_time
async def test_a_camera_that_is_missing_is_not_even_started(tmp_path: Path) -> None:
    film = tmp_path / "film.mkv"
    preview = Preview(tmp_path, cameras={**ROBOT, "arm": FileSource(path=film)})
    async with preview.serving():
        preview.supervisor.apply(FRONT)
        await is_live(preview, "front")
        preview.supervisor.apply(ARM)
        actual = await preview.until(lambda it: cameras_of(it)["arm"] is CameraState.FAILED)
        assert cameras_of(actual) == {
            "front": CameraState.LIVE,
            "rear": CameraState.READY,
            "arm": CameraState.FAILED,
        }
        assert str(film) in actual.cameras[2].error
        film.write_bytes(b"x")
        await is_live(preview, "arm")


@in_virtual_time
async def test_the_newest_choice_of_a_camera_counts(tmp_path: Path) -> None:
    preview = Preview(tmp_path, cameras=ROBOT)
    async with preview.serving():
        preview.supervisor.apply(FRONT)
        await is_live(preview, "front")
        preview.supervisor.apply(REAR)
        preview.supervisor.apply(ARM)
        actual = preview.supervisor.actual()
        assert cameras_of(actual)["arm"] is CameraState.STARTING
        assert cameras_of(actual)["rear"] is CameraState.READY
        # Back to the live one: nothing is to be started any more.
        preview.supervisor.apply(replace(FRONT, revision=4))
        assert CameraState.STARTING not in cameras_of(preview.supervisor.actual()).values()
        await asyncio.sleep(10 * SHOW_S)
        assert cameras_of(preview.supervisor.actual())["front"] is CameraState.LIVE


@in_virtual_time
async def test_the_choice_of_a_camera_outlives_disabling(tmp_path: Path) -> None:
    preview = Preview(tmp_path, cameras=ROBOT)
    async with preview.serving():
        assert preview.supervisor.actual().wanted_camera == "front"
        preview.supervisor.apply(ARM)
        await is_live(preview, "arm")
        preview.supervisor.apply(DesiredState(4, False))
        actual = await preview.reaches(State.DISABLED)
        assert (actual.wanted_camera, cameras_of(actual)["arm"]) == ("arm", CameraState.READY)
        preview.supervisor.apply(DesiredState(5, True))
        await is_live(preview, "arm")


@in_virtual_time
async def test_an_unknown_camera_is_refused_and_changes_nothing(tmp_path: Path) -> None:
    preview = Preview(tmp_path, cameras=ROBOT)
    async with preview.serving():
        preview.supervisor.apply(FRONT)
        await is_live(preview, "front")
        with pytest.raises(InvalidRequestError, match=r"called 'back'; there are: front, rear, arm"):
            preview.supervisor.apply(DesiredState(9, True, Profile.LOW_BW, camera="back"))
        actual = preview.supervisor.actual()
        assert (actual.applied_revision, actual.profile, actual.wanted_camera) == (
            1,
            Profile.BALANCED,
            "front",
        )
        # It is no reason to go on.
        preview.supervisor.apply(DesiredState(10, False, camera="back"))
        await preview.reaches(State.DISABLED)


@in_virtual_time
async def test_a_camera_that_is_plugged_in_again_is_used_at_once(tmp_path: Path) -> None:
    script = Script(fault=SOURCE, fault_after_s=1, camera_faults={"front": SOURCE})
    preview = Preview(tmp_path, script, cameras=ROBOT)
    async with preview.serving():
        preview.supervisor.apply(FRONT)
        await is_live(preview, "rear")
        preview.supervisor.cameras_found({"front": "no such device"})
        await asyncio.sleep(20)
        assert preview.supervisor.unused_cameras == ("front", "arm")
        del script.camera_faults["front"]
        preview.supervisor.cameras_found({"front": ""})
        before = now()
        await is_live(preview, "front")
        assert now() - before == pytest.approx(SHOW_S)


@row("a camera hangs when it has been replaced")
@in_virtual_time
async def test_a_camera_that_hangs_ends_the_process_when_the_pipeline_is_stopped(tmp_path: Path) -> None:
    preview = Preview(tmp_path, Script(listener_hangs=True), cameras=ROBOT)
    async with preview.serving(dies_of="hung when it was stopped"):
        preview.supervisor.apply(FRONT)
        await is_live(preview, "front")
        preview.supervisor.apply(REAR)
        await is_live(preview, "rear")
        preview.supervisor.apply(replace(OFF, revision=7))
