"""A supervisor of the preview with doubles of its pipelines and of the trials, in virtual time."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TypeVar

import pytest

from common.errors import UserError
from preview.config import PreviewSettings, TestSource
from preview.encoders.catalogue import CATALOGUE, Encoder
from preview.encoders.crash_marker import CrashMarkerFile
from preview.encoders.probe import TrialProber, Verdict
from preview.encoders.selection import Selection
from preview.pipeline import sources
from preview.pipeline.events import Blame, Fault, HungError
from preview.pipeline.sources import SourcePlan
from preview.state.lifecycle import State
from preview.state.values import ActualState, DesiredState, Profile
from preview.supervisor.supervisor import Supervisor
from tests.support.pipeline_double import PipelineDoubles, Script

PROVEN = Verdict(present=True, proven=True, first_byte_ms=5)
NO_OUTPUT = Verdict(present=True, proven=False, reason="it produced no output")
SOURCE = Fault(Blame.SOURCE, "camera /dev/video0 has ended.")
STALLED = Fault(Blame.SOURCE, "camera /dev/video0 has sent no frame for 1.5 s.")
BLOCKED = Fault(Blame.SOURCE, "camera /dev/video0 has not started within 5 s.")
PORT = Fault(Blame.LISTENER, "UDP port 7100 on 0.0.0.0 can't be used")
ON = DesiredState(1, True, Profile.BALANCED)
OFF = DesiredState(2, False)
AGAIN = DesiredState(3, True, Profile.BALANCED)
LOOK_S = 5.0
"""The deadline of a look at a camera."""

Test = TypeVar("Test", bound=Callable[..., object])


def row(_failure: str) -> Callable[[Test], Test]:
    """Marks the test of a row of the supervisor's failure table, by its first column."""
    return lambda test: test


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
