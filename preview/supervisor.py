"""Makes the truth follow the wish. The only owner of the lifecycle and of the running pipeline.

Everything that happens (a wish, a first picture, a fault, a timer) first moves the pure lifecycle, at once
and on the loop; then one task brings the real world to where the lifecycle is. So an answer to the gateway
never waits for a pipeline, and no two state changes of a pipeline ever overlap. pipeline/runner.py has the
table of what can fail.

When an encoder is passed over for another one, the pipeline is rebuilt whole, listener included: viewers
lose their connection and come back to a stream that may be of another codec. That takes some tenths of a
second, and a viewer has to be able to reconnect anyway.
"""

import asyncio
import logging
import time
import uuid
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from common.errors import UserError
from preview.config import PreviewSettings
from preview.encoders.crash_marker import EncoderNote
from preview.lifecycle import Event, Lifecycle, State
from preview.pipeline.adaptive import BitrateController
from preview.pipeline.dot_dump import keep_drawing
from preview.pipeline.faults import Blame, Fault
from preview.pipeline.plan import Plan
from preview.pipeline.runner import HungError, Runner
from preview.planner import Planner
from preview.status import Status, StreamStatus
from preview.values import EncoderChoice, Wish

_log = logging.getLogger(__name__)

_STEADY_AFTER_S: Final = 15.0
"""A pipeline that ran this long has left its last fault behind."""
_PATIENCE_WITH_FAULTED_S: Final = 0.3
"""How long the next pipeline waits for the encoder of the last one; it may go on stopping meanwhile."""


class Supervisor:
    """The preview, wanted or not.

    Args:
        settings: the service's.
        planner: decides what each pipeline is made of.
        note: tells the next process, should this one die of an encoder.
        on_hung: called when a driver hangs so that only the end of the process frees it; told the name of
            the encoder to pass over next time (empty: not the encoder's doing) and why.
    """

    def __init__(
        self,
        settings: PreviewSettings,
        planner: Planner,
        note: EncoderNote,
        on_hung: Callable[[str, str], None],
    ) -> None:
        self._settings = settings
        self._planner = planner
        self._note = note
        self._on_hung = on_hung
        self._instance_id = uuid.uuid4().hex
        self._lifecycle = Lifecycle()
        self._wish = Wish()
        self._last_error = ""
        self._runner: Runner | None = None
        self._running_since = 0.0
        self._stopping: dict[asyncio.Task[bool], str] = {}
        """What is left of pipelines whose encoder did not stop at once, and its name."""
        self._passed_over = False
        """The newest fault was an encoder's."""
        self._retry_now = False
        self._retry_timer: asyncio.TimerHandle | None = None
        self._watchers = 0
        self._alone_timer: asyncio.TimerHandle | None = None
        self._wake = asyncio.Event()
        self._changed = asyncio.Event()

    # --- what others may ask ---

    def apply(self, wish: Wish) -> Status:
        """Takes a wish in; the way to it is told by the status.

        The same revision again is the same wish and changes nothing.
        """
        if wish.revision != self._wish.revision or wish.revision == 0:
            profile = wish.profile if wish.enabled else self._wish.profile
            self._wish = replace(wish, profile=profile)
            _log.info("wish %d: %s", wish.revision, f"on, {profile.value}" if wish.enabled else "off")
            self._follow_wish(renewed=True)
        self._mind_being_alone()
        return self.status()

    def status(self) -> Status:
        """What is, now."""
        runner = self._runner
        return Status(
            instance_id=self._instance_id,
            applied_revision=self._wish.revision,
            state=self._lifecycle.state,
            profile=runner.plan.profile if runner else self._wish.profile,
            last_error=self._last_error,
            counters=self._lifecycle.counters,
            port=self._settings.srt.port,
            latency_ms=self._settings.srt.latency_ms,
            stream=_stream(runner) if runner else None,
            encoder=runner.plan.choice if runner else None,
            measurement=runner.measurement if runner else None,
        )

    @property
    def changed(self) -> asyncio.Event:
        """Set at the next change; take it anew after every look at the status."""
        return self._changed

    def watcher_came(self) -> None:
        """Somebody watches the service."""
        self._watchers += 1
        self._mind_being_alone()

    def watcher_left(self) -> None:
        """One of them is gone."""
        self._watchers -= 1
        self._mind_being_alone()

    async def run(self, stop: asyncio.Event) -> None:
        """Makes the truth follow the wish until `stop`, then leaves no pipeline behind."""
        stopping = asyncio.create_task(stop.wait(), name="stop")
        while not stop.is_set():
            waking = asyncio.create_task(self._wake.wait(), name="wake")
            await asyncio.wait((stopping, waking), return_when=asyncio.FIRST_COMPLETED)
            waking.cancel()
            self._wake.clear()
            await self._settle()
        self._wish = replace(self._wish, enabled=False)
        self._follow_wish(renewed=False)
        await self._settle()

    # --- what happens: moves the lifecycle, on the loop, at once ---

    def _follow_wish(self, *, renewed: bool) -> None:
        """Moves the lifecycle towards the wish, as far as that goes without touching a pipeline."""
        state, torn_down = self._lifecycle.state, self._runner is None
        if not self._wish.enabled:
            if state is not State.DISABLED and (state is not State.FAULTED or torn_down):
                self._move(Event.DISABLE)
        elif state is State.DISABLED or (state is State.FAULTED and torn_down and renewed):
            if state is State.DISABLED:
                self._last_error = ""
            self._move(Event.ENABLE)
        elif state is State.FAULTED:
            self._retry_now = self._retry_now or renewed
        elif self._runner and self._runner.plan.listener.passphrase != self._wish.passphrase:
            # Another session: who had the old passphrase must not go on watching.
            self._move(Event.DISABLE)
        self._changed_now()

    def _move(self, event: Event) -> None:
        before = self._lifecycle.state
        after = self._lifecycle.handle(event)
        if self._retry_timer and after is not State.FAULTED:
            self._retry_timer.cancel()
            self._retry_timer = None
        if after is not before:
            _log.info("%s -> %s (%s)", before.value, after.value, event.value)
        self._changed_now()

    def _changed_now(self) -> None:
        self._wake.set()
        self._publish()

    def _publish(self) -> None:
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()

    def _first_picture(self) -> None:
        self._running_since = time.monotonic()
        self._move(Event.FIRST_FRAME)

    def _measured(self) -> None:
        if (
            time.monotonic() - self._running_since > _STEADY_AFTER_S
            and self._lifecycle.state is State.RUNNING
        ):
            self._lifecycle.note_steady()
        self._publish()

    def _failed(self, fault: Fault) -> None:
        """A pipeline, or the attempt to make one, failed."""
        _log.error("%s", fault.sentence)
        if self._lifecycle.state is State.STOPPING:
            return
        self._last_error = fault.sentence
        self._move(Event.FAILURE)
        if fault.blame is Blame.ENCODER and self._runner:
            self._planner.pass_over(self._runner.plan.encoder.name, fault.sentence)
            self._passed_over = True

    def _retry(self) -> None:
        self._retry_timer = None
        self._move(Event.RETRY)

    def _mind_being_alone(self) -> None:
        """A preview nobody asks about any more ends by itself; a gateway that is back wishes anew."""
        limit_s = self._settings.timeouts.without_gateway_s
        if self._alone_timer:
            self._alone_timer.cancel()
            self._alone_timer = None
        if self._watchers == 0 and self._wish.enabled and limit_s > 0:
            self._alone_timer = asyncio.get_running_loop().call_later(limit_s, self._left_alone)

    def _left_alone(self) -> None:
        self._alone_timer = None
        limit_s = self._settings.timeouts.without_gateway_s
        self._last_error = (
            f"nobody has watched the preview service for {limit_s:g} s, so it stopped by itself"
        )
        _log.warning("%s", self._last_error)
        # Revision 0, so that the same wish, applied again, counts as a new one.
        self._wish = Wish(profile=self._wish.profile)
        self._follow_wish(renewed=True)

    # --- what is done about it: only ever by the task that runs run() ---

    async def _settle(self) -> None:
        """Brings the pipeline to where the lifecycle is, until both agree."""
        while await self._step():
            self._publish()

    async def _step(self) -> bool:
        """One thing that is left to do; False when nothing is."""
        state, runner = self._lifecycle.state, self._runner
        if state is State.STOPPING:
            await self._tear_down()
            if not self._wish.enabled:
                await self._finish_stopping()
            self._move(Event.STOPPED)
            self._after_stop()
            return True
        if state is State.FAULTED:
            return await self._recover()
        if state is State.STARTING and runner is None:
            await self._start()
            return True
        if runner and runner.plan.profile is not self._wish.profile and state is not State.DISABLED:
            await self._switch(runner)
            return True
        return False

    def _after_stop(self) -> None:
        if self._wish.enabled:
            self._last_error = ""
            self._move(Event.ENABLE)

    async def _recover(self) -> bool:
        if self._runner:
            await self._tear_down()
        if self._passed_over:
            self._passed_over = False
            await self._planner.try_encoders()
            if self._planner.has_another:
                self._lifecycle.note_fallback()
                self._retry_now = True
        if not self._wish.enabled:
            self._move(Event.DISABLE)
        elif self._retry_now:
            self._retry_now = False
            self._move(Event.RETRY)
        elif self._retry_timer is None:
            delay_s = self._lifecycle.retry_delay_s
            _log.info("next attempt in %g s", delay_s)
            self._retry_timer = asyncio.get_running_loop().call_later(delay_s, self._retry)
            return False
        else:
            return False
        return True

    async def _start(self) -> None:
        await self._planner.try_encoders()
        if self._lifecycle.state is not State.STARTING:
            return
        try:
            plan = self._planner.plan(self._wish)
            self._tell_software(plan.choice)
            runner = self._runner = self._new_runner(plan)
        except UserError as error:
            self._failed(Fault(Blame.OTHER, str(error)))
            return
        self._retry_now = False
        self._note.begin(plan.encoder.name)
        await runner.start()

    def _new_runner(self, plan: Plan) -> Runner:
        target = plan.target
        return Runner(
            plan,
            self._settings.timeouts,
            on_first_picture=self._first_picture,
            on_fault=self._failed,
            on_measured=self._measured,
            controller=BitrateController(target.bitrate_kbps, target.floor_kbps)
            if self._settings.adaptive.enabled
            else None,
        )

    def _tell_software(self, choice: EncoderChoice) -> None:
        """A robot that is meant to encode in hardware and doesn't has a fault, even though pictures flow."""
        if self._planner.wants_hardware and not choice.hardware:
            sentence = (
                f"no hardware encoder works, so the CPU encodes with {choice.name}: {choice.fallback_reason}"
            )
            _log.warning("%s", sentence)
            self._last_error = sentence

    async def _switch(self, runner: Runner) -> None:
        profile = self._wish.profile
        _log.info("profile %s -> %s", runner.plan.profile.value, profile.value)
        await runner.switch(profile, self._settings.profiles.targets[profile])

    async def _tear_down(self) -> None:
        """Stops the pipeline. After a fault it does not wait long for the encoder: a viewer waits, too."""
        runner = self._runner
        if runner is None:
            return
        faulted = self._lifecycle.state is State.FAULTED
        if faulted:
            await keep_drawing(runner, self._settings.runtime_dir)
        try:
            rest = await runner.stop()
        except HungError as error:
            self._on_hung("", str(error))
            return
        self._stopping[rest] = runner.plan.encoder.name
        await asyncio.wait({rest}, timeout=_PATIENCE_WITH_FAULTED_S if faulted else None)
        self._runner = None
        self._stopping = {rest: name for rest, name in self._stopping.items() if not _is_over(rest)}
        if not self._stopping:
            self._note.end()

    async def _finish_stopping(self) -> None:
        """Waits for encoders that were left behind; ends the process when one of them never comes back."""
        if self._stopping:
            await asyncio.wait(self._stopping)
        hung = [name for rest, name in self._stopping.items() if not _is_over(rest)]
        self._stopping.clear()
        if hung:
            self._on_hung(hung[0], "it hung when it was stopped")


def _is_over(rest: "asyncio.Task[bool]") -> bool:
    """Whether a pipeline is stopped; not when it is still at it or hangs for good."""
    return rest.done() and rest.result()


def _stream(runner: Runner) -> StreamStatus:
    return StreamStatus(
        target=runner.plan.target,
        bitrate_kbps=runner.bitrate_kbps,
        bitrate_reason=runner.bitrate_reason,
        codec=runner.plan.encoder.codec,
        encrypted=runner.plan.listener.encrypted,
    )
