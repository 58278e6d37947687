"""The supervisor with pipeline doubles, in virtual time: every row of its failure table, and its requests."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import pytest

from common.errors import InvalidRequestError, NotRunningError, UserError
from preview import supervisor
from preview.cameras import CameraState
from preview.config import FileSource, PreviewSettings, TestSource, TimeoutSettings
from preview.encoders.catalogue import CATALOGUE, Encoder
from preview.encoders.crash_marker import CrashMarkerFile
from preview.encoders.probe import TrialProber, Verdict
from preview.encoders.selection import Selection
from preview.lifecycle import STEADY_AFTER_S, Counters, Reason, State
from preview.pipeline import sources
from preview.pipeline.events import AccessUnit, Blame, Fault, HungError
from preview.pipeline.sources import SourcePlan
from preview.supervisor import ENCODER_STOP_S, GRAPH, Supervisor
from preview.values import ActualState, DesiredState, Profile
from tests.support.pipeline_double import FIRST_FRAME_S, SHOW_S, STOP_DEADLINE_S, PipelineDoubles, Script
from tests.support.virtual_time import in_virtual_time

PROVEN = Verdict(present=True, proven=True, first_byte_ms=5)
NO_OUTPUT = Verdict(present=True, proven=False, reason="it produced no output")
ENCODER = Fault(Blame.ENCODER, "encoder mpp-h265 failed: hardware fault")
SILENT = Fault(Blame.ENCODER, "encoder mpp-h265 has produced no frame for 1.0 s")
STUCK = Fault(Blame.ENCODER, "encoder mpp-h265 hung when the profile was changed")
SOURCE = Fault(Blame.SOURCE, "camera /dev/video0 has ended.")
STALLED = Fault(Blame.SOURCE, "camera /dev/video0 has sent no frame for 1.5 s.")
BLOCKED = Fault(Blame.SOURCE, "camera /dev/video0 has not started within 5 s.")
ACCEPT = Fault(Blame.LISTENER, "the SRT listener on port 7100 failed: a caller could not be accepted.")
PORT = Fault(Blame.LISTENER, "UDP port 7100 on 0.0.0.0 can't be used")
ON = DesiredState(1, True, Profile.BALANCED)
OFF = DesiredState(2, False)
AGAIN = DesiredState(3, True, Profile.BALANCED)

LOOK_S = 5.0
"""The deadline of a look at a camera."""

Test = TypeVar("Test", bound=Callable[..., object])
tested: set[str] = set()


def row(failure: str) -> Callable[[Test], Test]:
    """Marks the test of a row of the failure table, by its first column."""

    def mark(test: Test) -> Test:
        tested.add(failure)
        return test

    return mark


def test_every_row_of_the_failure_table_has_a_test() -> None:
    rows = [line.split("|")[1].strip() for line in str(supervisor.__doc__).splitlines() if line[:1] == "|"]
    assert rows[:2] == ["failure", "---"]
    assert set(rows[2:]) == tested


def prober(trial_s: float = 0.0, **results: Verdict) -> TrialProber:
    """Trials with these results, by default good ones; each takes `trial_s`."""

    async def attempt(encoder: Encoder) -> Verdict:
        await asyncio.sleep(trial_s)
        return results.get(encoder.name.replace("-", "_"), PROVEN)

    return TrialProber(attempt)


class Marker(CrashMarkerFile):
    """Keeps what the crash marker says now."""

    def __init__(self, directory: Path) -> None:
        super().__init__(directory)
        self.encoder = ""
        self.reason = ""
        self.proven: list[str] = []

    def set(self, encoder: str, reason: str = "", proven: Iterable[str] = ()) -> None:
        self.encoder, self.reason, self.proven = encoder, reason, list(proven)

    def clear(self) -> None:
        self.encoder = self.reason = ""


class Preview:
    """A supervisor and what it works with.

    Args:
        directory: runtime directory.
        scripts: what happens to its pipelines, in turn.
        trials: by default, every encoder works.
        order: allowed encoders.
        settings: that differ from the defaults.
    """

    def __init__(
        self,
        directory: Path,
        *scripts: Script,
        trials: TrialProber | None = None,
        order: tuple[str, ...] = ("mpp-h265", "va-h265", "x264"),
        **settings: object,
    ) -> None:
        loop = asyncio.get_running_loop()
        values = {"source": TestSource(), "runtime_dir": directory, **settings}
        self.pipelines = PipelineDoubles(*scripts)
        self.marker = Marker(directory)
        self.selection = Selection([CATALOGUE[name] for name in order], 600, trials or prober(), loop.time)
        self.hung = set[str]()
        """Cameras of which a look does not return; in virtual time, there are no threads."""
        self._settings = PreviewSettings(**values)  # type: ignore[arg-type]
        self.supervisor = Supervisor(
            self._settings, self.selection, self.marker, self.pipelines, self._plan_camera
        )
        self.stop = asyncio.Event()

    @asynccontextmanager
    async def serving(self, *, dies_of: str = "") -> AsyncIterator["Preview"]:
        """Runs the supervisor, watched by a gateway; then stops it, or waits until a hang ends it."""
        running = asyncio.create_task(self.supervisor.run(self.stop))
        with self.supervisor.watched():
            yield self
            assert not running.done()
            if dies_of:
                with pytest.raises(HungError, match=dies_of):
                    await running
                return
        self.stop.set()
        await running

    async def _plan_camera(self, camera: str) -> SourcePlan:
        if camera in self.hung:
            await asyncio.sleep(LOOK_S)
            raise UserError(f"camera {camera} does not answer")
        return sources.plan_camera(self._settings, camera)

    async def until(self, holds: Callable[[ActualState], bool]) -> ActualState:
        """Waits for a condition of the actual state, at most some virtual minutes."""
        assert await self.supervisor.changes.wait_until(lambda: holds(self.supervisor.actual()), 300)
        return self.supervisor.actual()

    async def reaches(self, state: State) -> ActualState:
        return await self.until(lambda actual: actual.state is state)

    async def runs_with(self, encoder: str) -> ActualState:
        def holds(actual: ActualState) -> bool:
            return bool(actual.state is State.RUNNING and actual.encoder and actual.encoder.name == encoder)

        return await self.until(holds)


def now() -> float:
    return asyncio.get_running_loop().time()


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


@row("port in use, address not local")
@in_virtual_time
async def test_a_port_in_use(tmp_path: Path) -> None:
    await retried(Preview(tmp_path, Script(fault=PORT)), PORT.text)


async def front_is_lost(preview: Preview) -> float:
    """Shows front until its fallback is being started in its place; returns when that was."""
    preview.supervisor.apply(FRONT)
    await is_live(preview, "front")
    await preview.until(lambda it: cameras_of(it)["rear"] is CameraState.STARTING)
    return now()


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
