"""A pipeline without GStreamer: serves imaginary frames, and fails as it is scripted.

It passes the tests of pipeline_contract.py, as the real one does.
"""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from common.errors import UserError
from preview.pipeline.events import AccessUnit, Blame, Fault, HungError, PipelineEvents
from preview.pipeline.plan import Plan
from preview.pipeline.sources import SourcePlan
from preview.state.values import Measurement, Profile, StreamState

FIRST_FRAME_S = 0.05
SHOW_S = 0.05
WINDOW_S = 0.5
STOP_DEADLINE_S = 3.0


@dataclass(frozen=True)
class Script:
    """What happens to a pipeline.

    Args:
        build_error: building it raises this.
        fault: reported instead of the first frame, or `fault_after_s` after it.
        fault_after_s: 0: no frame comes.
        fault_in_switch: reported when the profile is switched.
        camera_faults: of cameras that are shown while it runs, by name.
        fault_in_stop: reported while it is being stopped.
        listener_faults: of the listeners that are opened while it runs, in turn.
        viewers_refused: in each window.
        stop_s: how long its encoder takes to stop.
        encoder_hangs: its encoder never stops.
        listener_hangs: its listener never stops.
    """

    build_error: str = ""
    fault: Fault | None = None
    fault_after_s: float = 0.0
    fault_in_switch: Fault | None = None
    camera_faults: dict[str, Fault] = field(default_factory=dict)
    fault_in_stop: Fault | None = None
    listener_faults: list[Fault] = field(default_factory=list)
    viewers_refused: int = 0
    stop_s: float = 0.02
    encoder_hangs: bool = False
    listener_hangs: bool = False


class PipelineDouble:
    """One pipeline. A source description with "num-buffers" ends, as GStreamer's would."""

    def __init__(self, plan: Plan, events: PipelineEvents, script: Script | None = None) -> None:
        self.plan = plan
        self.measurement: Measurement | None = None
        self.stopped = False
        self.key_frames_requested: list[int | None] = []
        self.picture_ages_ms: list[int] = []
        self.listened: list[str | None] = []
        """Passphrases of the listeners that took the place of the first one; None: it was closed."""
        self.take: Callable[[AccessUnit], None] | None = None
        self._events = events
        self._script = script or _script_of(plan)
        self._serving: asyncio.Task[None] | None = None
        self._begun = False
        self._lost: Fault | None = None
        self.starting_camera: str | None = None
        self._showing: asyncio.TimerHandle | None = None
        if self._script.build_error:
            raise UserError(self._script.build_error)

    @property
    def stream(self) -> StreamState:
        plan = self.plan
        return StreamState(
            plan.target, plan.target.bitrate_kbps, "", plan.encoder.codec, bool(plan.passphrase)
        )

    async def start(self) -> None:
        self._serving = asyncio.create_task(self._serve())

    async def switch(self, profile: Profile) -> None:
        self.plan = replace(self.plan, profile=profile)
        if self._script.fault_in_switch:
            self._fail(self._script.fault_in_switch)

    @property
    def live_camera(self) -> str | None:
        return None if self._lost else self.plan.source.camera

    def show(self, source: SourcePlan | None) -> None:
        if self._showing:
            self._showing.cancel()
        self._showing, self.starting_camera = None, None
        if source:
            self.starting_camera = source.camera
            self._showing = asyncio.get_running_loop().call_later(SHOW_S, self._shown, source)
        elif self._lost:
            self._fail(self._lost)

    def lose_camera(self, fault: Fault) -> None:
        """The live camera fails."""
        self._lost = fault
        if not self._events.camera_failed(self.plan.source.camera, fault):
            self._fail(fault)

    def lose_listener(self, fault: Fault) -> None:
        """The listener fails."""
        if not self._events.listener_failed(fault):
            self._fail(fault)

    def _shown(self, source: SourcePlan) -> None:
        self.starting_camera = None
        if fault := self._script.camera_faults.get(source.camera):
            goes_on = self._events.camera_failed(source.camera, fault)
            if self._lost and not goes_on:
                self._fail(self._lost)
            return
        self.plan = replace(self.plan, source=source)
        self._lost = None
        self._events.camera_shown(source.camera)

    async def listen(self, passphrase: str | None) -> None:
        self.plan = replace(self.plan, passphrase=passphrase)
        self.listened.append(passphrase)
        if passphrase is not None and self._script.listener_faults:
            self.lose_listener(self._script.listener_faults.pop(0))

    def record(self, take: Callable[[AccessUnit], None] | None) -> None:
        self.take = take

    def request_key_frame(self, newest_pts: int | None) -> bool:
        self.key_frames_requested.append(newest_pts)
        return len(self.key_frames_requested) == 1

    def take_picture_age(self, age_ms: int) -> None:
        self.picture_ages_ms.append(age_ms)

    async def stop(self) -> "asyncio.Task[bool]":
        if self._script.fault_in_stop:
            self._fail(self._script.fault_in_stop)
        self._end()
        if self._script.listener_hangs:
            await asyncio.sleep(STOP_DEADLINE_S)
            raise HungError("the SRT listener hung when it was stopped")
        self.stopped = True
        return asyncio.create_task(self._stop_encoder())

    async def write_graph(self, path: Path) -> None:
        _write(path, "digraph double {}\n")

    async def _serve(self) -> None:
        script = self._script
        await asyncio.sleep(FIRST_FRAME_S)
        if script.fault is None or script.fault_after_s:
            self._begun = True
            self._events.first_frame()
        if script.fault:
            asyncio.get_running_loop().call_later(script.fault_after_s, self._fail_by_script, script.fault)
        while True:
            await asyncio.sleep(WINDOW_S)
            if self.take:
                self.take(AccessUnit(b"a frame", captured_ns=1, key_frame=True))
            self.measurement = Measurement(self.plan.target.fps, self.plan.target.bitrate_kbps, 0, 10)
            self._events.measured(self._script.viewers_refused)

    def _fail_by_script(self, fault: Fault) -> None:
        if fault.blame is Blame.SOURCE and self._begun and self._serving:
            self.lose_camera(fault)
        else:
            self._fail(fault)

    def _fail(self, fault: Fault) -> None:
        if self._end():
            self._events.failed(fault)

    def _end(self) -> bool:
        """Ends the frames; False when they had ended before."""
        if self._showing:
            self._showing.cancel()
        serving, self._serving = self._serving, None
        return serving is not None and serving.cancel()

    async def _stop_encoder(self) -> bool:
        await asyncio.sleep(STOP_DEADLINE_S if self._script.encoder_hangs else self._script.stop_s)
        return not self._script.encoder_hangs


class PipelineDoubles:
    """Builds them; the scripts are used in turn, then every pipeline works."""

    def __init__(self, *scripts: Script) -> None:
        self.built: list[PipelineDouble] = []
        self._scripts = list(scripts)

    def __call__(self, plan: Plan, events: PipelineEvents) -> PipelineDouble:
        script = self._scripts.pop(0) if self._scripts else Script()
        pipeline = PipelineDouble(plan, events, script)
        self.built.append(pipeline)
        return pipeline


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def _script_of(plan: Plan) -> Script:
    if "nonsense" in plan.source.description:
        return Script(build_error="the pipeline can't be built: no element nonsense")
    if "num-buffers" in plan.source.description:
        return replace(
            Script(), fault=Fault(Blame.SOURCE, f"{plan.source.label} has ended"), fault_after_s=0.2
        )
    return Script()
