"""Reconciles the preview with its desired state. The only owner of the lifecycle and of the pipeline.

Every event (a request, a first frame, a fault, a timer) only moves the pure lifecycle, at once and on the
loop; then one task, `run`, brings the pipeline to the lifecycle's state. So an answer to the gateway never
waits for a pipeline, and no two state changes of a pipeline overlap.

What can fail, how it is noticed, and what follows:

| failure | noticed by | follows |
|---|---|---|
| no encoder works | selection: UserError | FAULTED, retry with backoff |
| source unusable, element missing | building: UserError | FAULTED, retry with backoff |
| a look at a source hangs | deadline of the call | its fallback; or FAULTED, retry with backoff |
| port in use, address not local | ERROR of the listener | FAULTED, retry with backoff |
| source fails or ends | ERROR of the source, EOS | its fallback; a file loops instead |
| source stalls | watchdog: no frames come in | its fallback |
| no fallback, or none that works | state/cameras.py | FAULTED, retry with backoff |
| a camera to switch to fails | ERROR, EOS, no frame in time | the live one stays; retry with backoff |
| a camera hangs when it has been replaced | deadline of the call | left behind; HungError when stopped |
| encoder can't be opened or fails | ERROR of the encoder | next encoder at once |
| encoder is silent, or gives empty buffers | watchdog: frames go in, none come out | next encoder at once |
| source's or listener's driver blocks a start | deadline of the call | FAULTED, retry with backoff |
| encoder's driver blocks a start or an adjustment | deadline of the call | next encoder at once |
| last proven encoder fails | as above, and no alternative | FAULTED, retry with backoff |
| pipeline fails again after running steadily | 15 s in RUNNING before it | backoff starts again at 1 s |
| pipeline fails while it is being stopped | its fault, in STOPPING | logged, otherwise ignored |
| encoder hangs after a fault | teardown not finished after 0.3 s | left behind; port and source are free |
| encoder hangs when the preview is disabled | teardown not finished in time | crash marker, HungError |
| source or listener hangs when stopped | HungError of the pipeline | HungError |
| driver crashes the process | crash marker of the encoder in use | next process passes the encoder over |
| hardware preferred, only x264 works | selection | runs, and last_error says so |
| more viewers than srt.max_viewers | asked in SRT's handshake | refused, counted and logged |
| gateway is gone | no watcher for without_gateway_s | disabled until the next request |
| listener fails while running | ERROR of the listener | opened again: at once, then with backoff |
| listener fails again and again | a fourth failure without a steady run | FAULTED, retry with backoff |
| listener fails while recording | ERROR, deadline of its start | closed, retried with backoff |

HungError ends the process with code 70 (app.py), to be restarted: only that frees the driver. A slow, frozen
or vanished viewer is no failure: the listener drops it, and the others notice nothing. From GStreamer 1.24 on
one failed accept ends a listener: viewers are back within a moment, and the encoder goes on. When another
encoder takes over, the pipeline is rebuilt whole, listener included: viewers lose the connection for some
tenths of a second and must reconnect, to a stream of possibly another codec.

A fallback, and a camera that an operator chose, are started beside the live camera and take its place in the
running pipeline (camera_switch.py): viewers stay connected. state/cameras.py decides which one is to be live.

One pipeline serves two reasons: viewers (the desired state) and a recording (a reader of the video tap). It
runs while there is one. The listener exists only for viewers, and comes and goes without a gap in the
recording; state_for_viewers says what operators see.
"""

import asyncio
import logging
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Final

from common.broadcast import Broadcast
from common.errors import InvalidRequestError, NotRunningError, UserError
from common.timer import Timer
from preview.config import PreviewSettings
from preview.encoders.catalogue import CATALOGUE
from preview.encoders.crash_marker import CrashMarkerFile
from preview.encoders.selection import Selection
from preview.pipeline.events import Blame, Fault, PipelineEvents
from preview.pipeline.plan import Plan, make_plan
from preview.state.lifecycle import (
    STEADY_AFTER_S,
    Event,
    Lifecycle,
    Listening,
    Reason,
    State,
    state_for_viewers,
)
from preview.state.values import (
    CAPTURE_OFFSET_NS,
    ActualState,
    DesiredState,
    EncoderChoice,
    RecordedStream,
)
from preview.supervisor.camera_follower import CameraFollower
from preview.supervisor.last_error import LastError
from preview.supervisor.listener_retry import ListenerRetry
from preview.supervisor.ports import Pipeline, PlanCamera, Recording
from preview.supervisor.preparation import Preparation
from preview.supervisor.teardowns import Teardowns

_log = logging.getLogger(__name__)

GRAPH: Final = "last-fault.dot"
"""File in the runtime directory: the graph of the last failed pipeline."""
ENCODER_STOP_S: Final = 0.3
"""How long the next pipeline waits for the encoder of a failed one."""


class Supervisor:
    """The preview.

    Args:
        settings: of the service.
        encoders: chooses the encoder of each pipeline.
        marker: informs the next process if an encoder ends this one.
        new_pipeline: builds pipelines; raises UserError where one can't be built.
        plan_camera: plans cameras.
    """

    def __init__(
        self,
        settings: PreviewSettings,
        encoders: Selection,
        marker: CrashMarkerFile,
        new_pipeline: Callable[[Plan, PipelineEvents], Pipeline],
        plan_camera: PlanCamera,
    ) -> None:
        self._settings = settings
        self._encoders = encoders
        self._marker = marker
        self._new_pipeline = new_pipeline
        self.changes = Broadcast()
        """Notified of each change of the actual state."""
        self._instance_id = uuid.uuid4().hex
        self._lifecycle = Lifecycle()
        self._wake = asyncio.Event()
        self._desired = DesiredState()
        self._last_error = LastError()
        self._cameras = CameraFollower(settings, plan_camera, self.camera_failed)
        self._pipeline: Pipeline | None = None
        self._teardowns = Teardowns(marker, encoders)
        self._running_since = 0.0
        self._encoder_failed = False
        self._retry_now = False
        self._retry_timer = Timer(self._retry)
        self._watchers = 0
        self._unwatched_timer = Timer(self._disable_unwatched)
        self._recording: Recording | None = None
        self._listener_retry = ListenerRetry(self._wake.set)
        self._preparation = Preparation(encoders, plan_camera)
        self._closed = False

    # --- for the gateway ---

    def apply(self, desired: DesiredState) -> ActualState:
        """Accepts a desired state and returns the actual state at this moment.

        The same revision again is the same request and changes nothing; nor does any once the service stops.

        Raises:
            InvalidRequestError: enabled with an unknown camera.
        """
        known = not desired.camera or desired.camera in self._cameras.names
        if desired.enabled and not known:
            raise InvalidRequestError(
                f"no camera is called '{desired.camera}'; there are: {', '.join(self._cameras.names)}"
            )
        if self._closed:
            return self.actual()
        if desired.revision != self._desired.revision or desired.revision == 0:
            profile = desired.profile if desired.enabled else self._desired.profile
            if desired.enabled and not self._desired.enabled and self._lifecycle.state is State.RUNNING:
                self._last_error.clear()  # A new session, beside a recording.
            self._listener_retry.reset()
            self._desired = replace(desired, profile=profile)
            self._cameras.want(desired.camera if known else "")
            camera = f", camera {self._cameras.wanted}" if len(self._cameras.names) > 1 else ""
            mode = f"on, {profile.value}{camera}" if desired.enabled else "off"
            _log.info("desired state %d: %s", desired.revision, mode)
            self._follow_desired(new_request=True)
        self._restart_unwatched_timer()
        return self.actual()

    def actual(self) -> ActualState:
        """Returns the actual state."""
        state = self._state_for_viewers
        pipeline = self._pipeline if state is not State.DISABLED else None
        return ActualState(
            instance_id=self._instance_id,
            applied_revision=self._desired.revision,
            state=state,
            profile=self._desired.profile,
            last_error=self._last_error.text,
            counters=self._lifecycle.counters,
            address=self._settings.srt.reached_at,
            port=self._settings.srt.port,
            latency_ms=self._settings.srt.latency_ms,
            capture_offset_ns=CAPTURE_OFFSET_NS,
            stream=pipeline.stream if pipeline else None,
            encoder=pipeline.plan.choice if pipeline else None,
            measurement=pipeline.measurement if pipeline else None,
            pipeline_state=self._lifecycle.state,
            reasons=self._reasons,
            wanted_camera=self._cameras.wanted,
            cameras=self._cameras.listed(*self._live_and_starting),
        )

    @property
    def _live_and_starting(self) -> tuple[str | None, str | None]:
        """The live camera and the one that is being started; None for none."""
        if self._pipeline and self._lifecycle.state is State.STARTING:
            return None, self._pipeline.plan.source.camera
        return self._cameras.live_and_starting

    @property
    def _reasons(self) -> tuple[Reason, ...]:
        """Why a pipeline is to run."""
        holds = {Reason.VIEWERS: self._desired.enabled, Reason.RECORDING: self._recording is not None}
        return tuple(reason for reason in Reason if holds[reason])

    @property
    def _state_for_viewers(self) -> State:
        enabled, session = self._desired.enabled, self._pipeline.plan.passphrase if self._pipeline else None
        listening = Listening.NO
        if self._listener_retry.waits:
            listening = Listening.FAILED
        elif session is not None and (session == self._desired.passphrase or not enabled):
            listening = Listening.YES
        return state_for_viewers(self._lifecycle.state, enabled=enabled, listening=listening)

    def request_key_frame(self, newest_pts: int | None) -> bool:
        """Requests a key frame for a viewer that lost a picture; see `Pipeline.request_key_frame`.

        Raises:
            NotRunningError: no frames leave.
        """
        state = self._state_for_viewers
        if self._pipeline is None or state is not State.RUNNING:
            raise NotRunningError(f"the preview is {state.value}")
        return self._pipeline.request_key_frame(newest_pts)

    def take_picture_age(self, age_ms: int) -> None:
        """Takes the age of the oldest picture that a viewer shows; ignored without a pipeline."""
        if self._pipeline:
            self._pipeline.take_picture_age(age_ms)

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Counts as a gateway that watches the service."""
        self._watchers += 1
        self._restart_unwatched_timer()
        try:
            yield
        finally:
            self._watchers -= 1
            self._restart_unwatched_timer()

    # --- for the watch of the cameras ---

    @property
    def is_watched(self) -> bool:
        """Whether a gateway watches the service."""
        return self._watchers > 0

    @property
    def unused_cameras(self) -> tuple[str, ...]:
        """Names of the cameras that are neither live nor being started."""
        used = self._live_and_starting
        return tuple(name for name in self._cameras.names if name not in used)

    def cameras_found(self, problems: Mapping[str, str]) -> None:
        """Takes why cameras can't be used, by name; empty for those that are there."""
        self._cameras.found(problems)
        self.changes.notify_all()

    # --- for the video tap ---

    def record(self, recording: Recording | None) -> None:
        """Keeps a pipeline running for a recording, which gets every access unit; None: for none."""
        if self._closed and recording:
            return
        self._recording = recording
        if self._pipeline:
            self._pipeline.record(recording.take if recording else None)
        self._follow_desired(new_request=recording is not None)

    def recorded_stream(self) -> RecordedStream:
        """Returns what a recording notes of the present stream."""
        pipeline = self._pipeline
        return RecordedStream(
            state=self._lifecycle.state,
            profile=self._desired.profile,
            error=self._last_error.text,
            stream=pipeline.stream if pipeline else None,
            encoder=pipeline.plan.choice if pipeline else None,
            camera=pipeline.plan.source.camera if pipeline else "",
        )

    def request_recorded_key_frame(self) -> None:
        """Requests a key frame for a recording that begins; a pipeline that starts begins with one."""
        if self._pipeline and self._lifecycle.state is State.RUNNING:
            self._pipeline.request_key_frame(None)

    # --- reconciling: the pipeline follows the lifecycle; only the task of run() does this ---

    async def run(self, stop: asyncio.Event) -> None:
        """Reconciles until `stop`, then leaves no pipeline behind.

        Raises:
            HungError: a driver hangs; the process must end.
        """
        stopped = asyncio.create_task(stop.wait(), name="stop")
        stopped.add_done_callback(lambda _: self._close())
        while not self._closed:
            await self._wake.wait()
            self._wake.clear()
            while await self._step():
                self.changes.notify_all()

    def _close(self) -> None:
        self._closed = True
        self._desired = replace(self._desired, enabled=False)
        self._listener_retry.now()
        self.record(None)

    async def _step(self) -> bool:
        """Does one thing that the lifecycle's state requires; False when there is none."""
        pipeline, profile = self._pipeline, self._desired.profile
        match self._lifecycle.state:
            case State.STOPPING:
                await self._finish_stopping()
            case State.DISABLED if self._teardowns:
                await self._teardowns.join()
            case State.FAULTED:
                return await self._recover()
            case State.STARTING if pipeline is None:
                await self._start()
            case State.STARTING | State.RUNNING if pipeline and pipeline.plan.profile is not profile:
                _log.info("profile %s -> %s", pipeline.plan.profile.value, profile.value)
                await pipeline.switch(profile)
            case State.RUNNING if pipeline and self._must_replace_listener(pipeline):
                _log.info("listener: %s", "closed" if self._session is None else "opened")
                self._listener_retry.replaced()
                await pipeline.listen(self._session)
            case _:
                return False
        return True

    def _must_replace_listener(self, pipeline: Pipeline) -> bool:
        # A lost one has the right passphrase, once its retry is due.
        return self._listener_retry.is_lost or pipeline.plan.passphrase != self._session

    @property
    def _session(self) -> str | None:
        """The passphrase that the listener is to have at present; None: there is to be none."""
        return None if self._listener_retry.waits else self._desired.session

    async def _start(self) -> None:
        await self._preparation.find_encoder()
        if not self._is_starting():
            return
        try:
            encoder, choice = self._encoders.choose()
        except UserError as error:
            self.failed(Fault(Blame.OTHER, str(error)))
            return
        camera = self._cameras.first
        try:
            source = await self._preparation.plan(camera)
            if source is None or not self._is_starting():
                return
            plan = make_plan(self._settings, self._desired, encoder, choice, source)
            self._report_software_fallback(choice)
            pipeline = self._pipeline = self._new_pipeline(plan, self)
        except UserError as error:
            self._cameras.failed(camera, str(error))
            self.failed(Fault(Blame.SOURCE, str(error)))
            return
        self._retry_now = False
        self._marker.set(encoder.name, proven=self._encoders.proven)
        self._listener_retry.now()
        self._listener_retry.replaced()
        if self._recording:
            pipeline.record(self._recording.take)
        await pipeline.start()

    def _is_starting(self) -> bool:
        """Whether a pipeline is still to be started: a request may have come while something was awaited."""
        return self._lifecycle.state is State.STARTING

    def _report_software_fallback(self, choice: EncoderChoice) -> None:
        """Software encoding on a robot with hardware encoders is an error, even though frames flow."""
        if CATALOGUE[choice.wanted].hardware and not choice.hardware:
            self._last_error.report(
                f"no hardware encoder works, so the CPU encodes with {choice.name}: {choice.fallback_reason}",
                logging.WARNING,
            )

    async def _recover(self) -> bool:
        """Tears the failed pipeline down and arranges what follows; False when only waiting is left."""
        if self._pipeline:
            await self._pipeline.write_graph(self._settings.runtime_dir / GRAPH)
            await self._tear_down(self._pipeline, wait_s=ENCODER_STOP_S)
        if self._encoder_failed:
            self._encoder_failed = False
            if await self._preparation.find_encoder():
                self._lifecycle.count(fallbacks=1)
                self._retry_now = True
            if self._lifecycle.state is not State.FAULTED:
                return True  # A request came during the trials.
        if not self._reasons:
            self._move(Event.DISABLE)
        elif self._retry_now:
            self._retry_now = False
            self._move(Event.RETRY)
        else:
            if not self._retry_timer:
                delay_s = self._lifecycle.retry_delay_s
                _log.info("next attempt in %g s", delay_s)
                self._retry_timer.start(delay_s)
            return False
        return True

    async def _finish_stopping(self) -> None:
        if self._pipeline:
            await self._tear_down(self._pipeline, wait_s=None)
        if not self._reasons:
            await self._teardowns.join()
        self._move(Event.STOPPED)
        if self._reasons:
            # Another passphrase, or enabled again in the meantime.
            self._last_error.clear()
            self._move(Event.ENABLE)

    async def _tear_down(self, pipeline: Pipeline, wait_s: float | None) -> None:
        """Stops a pipeline; waits for its encoder for `wait_s`, None: until its own deadline."""
        if self._recording:
            self._recording.interrupted()
        teardown = await pipeline.stop()
        await self._teardowns.wait_for(teardown, pipeline.plan.encoder.name, wait_s)
        self._pipeline = None

    # --- events: move the lifecycle, on the loop, at once ---

    def first_frame(self) -> None:
        """Handles the first frame of the pipeline."""
        self._running_since = asyncio.get_running_loop().time()
        self._listener_retry.serves()
        self._move(Event.FIRST_FRAME)
        if self._pipeline:
            self._cameras.delivers(self._pipeline.plan.source.camera)

    def measured(self, viewers_refused: int) -> None:
        """Handles new statistics of the pipeline."""
        if viewers_refused:
            limit = self._settings.srt.max_viewers
            _log.warning("refused %d viewers: %d are connected (srt.max_viewers)", viewers_refused, limit)
            self._lifecycle.count(viewers_refused=viewers_refused)
        running_s = asyncio.get_running_loop().time() - self._running_since
        if self._lifecycle.state is State.RUNNING and running_s > STEADY_AFTER_S:
            self._lifecycle.reset_backoff()
        self.changes.notify_all()

    def camera_shown(self, camera: str) -> None:
        """Handles another camera that is live now."""
        _log.info("camera %s is live", camera)
        self._cameras.delivers(camera)
        self.changes.notify_all()

    def camera_failed(self, camera: str, fault: Fault) -> bool:
        """Handles the fault of a camera; whether the pipeline goes on, with the live one or another."""
        self._last_error.report(fault.text)
        self._cameras.failed(camera, fault.text)
        self.changes.notify_all()
        return any(self._live_and_starting)

    def listener_failed(self, fault: Fault) -> bool:
        """Handles the fault of a listener; whether the pipeline goes on, and it is opened again."""
        running = self._lifecycle.state is State.RUNNING
        if not self._listener_retry.failed(running=running, recorded=self._recording is not None):
            return False
        self._last_error.report(fault.text)
        _log.info("the pipeline goes on without a listener")
        self._wake.set()
        self.changes.notify_all()
        return True

    def failed(self, fault: Fault) -> None:
        """Handles the fault of a pipeline, or of the attempt to build one."""
        if self._lifecycle.state is State.STOPPING:
            _log.error("%s", fault.text)
            return
        self._last_error.report(fault.text)
        if fault.blame is Blame.SOURCE:
            if self._pipeline and self._lifecycle.state is State.STARTING:
                # While running, the pipeline has reported it before.
                self._cameras.failed(self._pipeline.plan.source.camera, fault.text)
            self._retry_now = self._retry_now or self._cameras.has_one_to_try
        self._move(Event.FAILURE)
        if fault.blame is Blame.ENCODER and self._pipeline:
            self._encoders.pass_over(self._pipeline.plan.encoder.name, fault.text)
            self._encoder_failed = True

    def _retry(self) -> None:
        self._move(Event.RETRY)

    def _follow_desired(self, *, new_request: bool) -> None:
        """Moves the lifecycle towards the desired state, as far as no pipeline must be stopped first."""
        state, torn_down = self._lifecycle.state, self._pipeline is None
        if not self._reasons:
            if state is not State.DISABLED and (state is not State.FAULTED or torn_down):
                self._move(Event.DISABLE)
        elif state is State.DISABLED or (state is State.FAULTED and torn_down and new_request):
            if state is State.DISABLED:
                self._last_error.clear()
            self._move(Event.ENABLE)
        elif state is State.FAULTED:
            self._retry_now = self._retry_now or new_request
        elif (
            self._recording is None
            and self._pipeline
            and self._pipeline.plan.passphrase not in (None, self._desired.passphrase)
        ):
            # A new session: viewers that know the old passphrase must be disconnected.
            self._move(Event.DISABLE)
        elif new_request:
            self._cameras.follow(new_request=True)
            # The start begins anew, with the other camera.
            self._preparation.give_up_other_than(self._cameras.first)
        self._wake.set()
        self.changes.notify_all()

    def _restart_unwatched_timer(self) -> None:
        """Restarts the timer that disables the preview when no gateway watches it."""
        limit_s = self._settings.timeouts.without_gateway_s
        self._unwatched_timer.cancel()
        if self._watchers == 0 and self._desired.enabled and limit_s > 0:
            self._unwatched_timer.start(limit_s)

    def _disable_unwatched(self) -> None:
        limit_s = self._settings.timeouts.without_gateway_s
        text = f"the preview stopped by itself: no gateway has watched it for {limit_s:g} s"
        self._last_error.report(text, logging.WARNING)
        # Revision 0, so that the same revision counts as a new request.
        self._desired = DesiredState(profile=self._desired.profile)
        self._follow_desired(new_request=True)

    def _move(self, event: Event) -> None:
        before = self._lifecycle.state
        after = self._lifecycle.handle(event)
        if after is not State.FAULTED:
            self._retry_timer.cancel()
        if after is not State.RUNNING:
            self._cameras.detach()
        elif before is not State.RUNNING and self._pipeline:
            self._cameras.attach(self._pipeline)
        if event is Event.DISABLE:
            self._preparation.give_up()
        if after is not before:
            _log.info("%s -> %s (%s)", before.value, after.value, event.value)
        self._wake.set()
        self.changes.notify_all()
