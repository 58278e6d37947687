"""A running pipeline, seen from the loop: start, watch, change, stop.

What can fail, how it is noticed, and what follows:

| failure | noticed by | follows |
|---|---|---|
| an element is missing, a description makes no sense | building: UserError | FAULTED, retry |
| port taken, address not ours | ERROR of the sink while starting | FAULTED "UDP port ...", retry |
| camera or file can't be opened, unplugged, unreadable | ERROR of the source | FAULTED, retry |
| source ends | EOS on the bus | FAULTED, retry; a file begins again instead |
| source stalls without a word | watchdog: no new frames | FAULTED, retry |
| encoder can't be opened | ERROR of the encoder while starting | next encoder at once |
| encoder fails later | ERROR of the encoder | next encoder at once |
| encoder gives nothing, or empty buffers | watchdog: frames go in, nothing comes out | next encoder at once |
| starting blocks | deadline of the call | as a failure of the encoder |
| another profile, a bit rate or a request for a key frame blocks | deadline of the call | next encoder |
| stopping blocks in the encoder | deadline | left behind, its port and source free; next encoder |
| stopping blocks elsewhere | deadline of the call | the process ends with code 70, to be started again |
| a viewer is slow, frozen, gone, a stranger | the listener drops it | others notice nothing |

A process with an abandoned pipeline ends, with code 70, when the preview is next disabled: only that frees
the driver. GStreamer's threads meet us in few places (framing.py, joining.py, looping.py) and hand over to
the loop. Whatever may block in a driver (state changes, live figures, requests for key frames) runs in a
thread of its own with a deadline.
"""

import asyncio
import logging
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, Final

from common.gst import Gst
from preview.config import TimeoutSettings
from preview.encoders import properties
from preview.pipeline import builder, faults, statistics
from preview.pipeline.adaptive import BitrateController, Decision
from preview.pipeline.faults import Blame, Fault
from preview.pipeline.file_loop import Looping
from preview.pipeline.framing import Framing
from preview.pipeline.keyframe_gate import Joining
from preview.pipeline.plan import Plan
from preview.pipeline.threads import Crossing, in_thread
from preview.pipeline.watchdogs import Silent, Watchdogs
from preview.values import Measurement, Profile, Target

_log = logging.getLogger(__name__)

_LOOK_EVERY_S: Final = 0.2
MEASURE_EVERY_S: Final = 0.5
_DRIVER_DEADLINE_S: Final = 2.0
"""For what an encoder is told while it runs."""
_INTERESTING: Final = Gst.MessageType.ERROR | Gst.MessageType.WARNING | Gst.MessageType.EOS


class HungError(Exception):
    """The listener or the source can't be stopped: only the end of the process frees port and device."""


class Runner:
    """One pipeline from building to stopping. Made, used and dropped on the loop.

    Args:
        plan: what to build.
        timeouts: how long things may take.
        on_first_picture: called once when the first encoded picture reached the listener.
        on_fault: called with the first thing that failed, once.
        on_measured: called when there are new figures.
        controller: follows the viewers' links with the bit rate. None: it stays.

    Raises:
        UserError: the pipeline can't be built.
    """

    def __init__(
        self,
        plan: Plan,
        timeouts: TimeoutSettings,
        *,
        on_first_picture: Callable[[], None],
        on_fault: Callable[[Fault], None],
        on_measured: Callable[[], None],
        controller: BitrateController | None = None,
    ) -> None:
        self.plan = plan
        self.measurement: Measurement | None = None
        self.bitrate_kbps = plan.target.bitrate_kbps
        self.bitrate_reason = ""
        self._timeouts = timeouts
        self._on_first_picture = on_first_picture
        self._on_fault = on_fault
        self._on_measured = on_measured
        self._controller = controller
        self._loop = asyncio.get_running_loop()
        self._crossing = Crossing()
        self._parts = builder.build(plan)
        self._framing = Framing(lambda: self._crossing.hand_over(self._first_picture), plan.target.fps)
        self._framing.attach(self._parts.muxer_pad)
        self._looping = Looping(self._parts, self._crossing, self._loop_failed) if plan.source.loops else None
        self._joining = Joining(self._parts, self._crossing, self._request_key_frame)
        self._bus = self._parts.pipeline.get_bus()
        self._bus_fd = self._bus.get_pollfd().fd
        self._watch: asyncio.Task[None] | None = None
        self._key_frame: asyncio.Task[None] | None = None
        self._new_bitrate: asyncio.Task[None] | None = None
        self._telling = asyncio.Lock()
        """Held while the encoder is told something."""
        self._over: asyncio.Future[None] = self._loop.create_future()
        """Done when it has failed or is being stopped."""

    async def start(self) -> None:
        """Starts the pipeline. What fails is told through `on_fault`, also after this has returned."""
        self._loop.add_reader(self._bus_fd, self._read_bus)
        pipeline = self._parts.pipeline
        try:
            outcome = await in_thread(lambda: pipeline.set_state(Gst.State.PLAYING), self._timeouts.start_s)
        except TimeoutError:
            self.fail(faults.from_silence(Silent.ENCODER, self._timeouts.start_s, self.plan))
            return
        self._read_bus()
        if outcome == Gst.StateChangeReturn.FAILURE:
            # An element that refuses without saying why left no message behind.
            self.fail(faults.unexplained(self.plan))
            return
        self._watch = asyncio.create_task(self._supervise(), name="supervision")

    async def stop(self) -> "asyncio.Task[bool]":
        """Tears the pipeline down, each part with a deadline.

        First the listener, so that its port is free and viewers know, then the source, so that its device
        is free: so the next pipeline can start whatever becomes of the rest.

        Returns:
            The rest: the encoder and all around it. True when it is stopped, False when it hangs for good.

        Raises:
            HungError: the listener or the source hangs.
        """
        self._end()  # Whatever fails from here on is the teardown's own doing.
        await self._stop_watching()
        deadline_s = self._timeouts.stop_s
        for part, name in (
            (self._parts.sink, "the SRT listener"),
            (self._parts.source, self.plan.source.label),
        ):
            try:
                await in_thread(partial(_to_null, part), deadline_s)
            except TimeoutError as error:
                raise HungError(f"{name} hung when it was stopped") from error
        del part
        return asyncio.create_task(self._stop_rest(self._let_go(), deadline_s), name="stop the encoder")

    def _let_go(self) -> list[Any]:
        """Cuts every tie to the pipeline; what is returned is the last reference to it."""
        self._joining.detach()
        self._framing.detach()
        if self._looping:
            self._looping.detach()
            self._looping = None
        last = [self._parts.pipeline]
        del self._parts, self._bus
        return last

    async def _stop_rest(self, last: list[Any], deadline_s: float) -> bool:
        def stop() -> None:
            last[0].set_state(Gst.State.NULL)
            # Forgotten here, in this thread: SRT frees the port for good, and cleans up after itself, when
            # its last element is gone, and both take their time.
            last.clear()

        try:
            await in_thread(stop, deadline_s)
        except TimeoutError:
            return False
        return True

    async def switch(self, profile: Profile, target: Target) -> None:
        """Goes on with another profile; viewers stay connected."""
        plan = self.plan = self.plan.switched(profile, target)
        self.bitrate_kbps, self.bitrate_reason = target.bitrate_kbps, ""
        if self._controller:
            self._controller.retarget(target.bitrate_kbps, target.floor_kbps)

        dials, framing = self._parts.dials, self._framing

        def change() -> None:
            builder.apply_target(dials, plan)
            framing.set_rate(target.fps)

        await self._tell_encoder(change, "the profile was changed")

    async def _tell_encoder(self, call: Callable[[], None], when: str) -> None:
        """Makes a call that may block in the encoder's driver: one at a time, and none once it is over."""
        async with self._telling:
            if self._over.done():
                return
            told = asyncio.create_task(in_thread(call, _DRIVER_DEADLINE_S), name=f"encoder: {when}")
            try:
                # Another failure meanwhile is not kept waiting: a viewer sits in the dark.
                await asyncio.wait((told, self._over), return_when=asyncio.FIRST_COMPLETED)
                if told.done():
                    told.result()
            except TimeoutError:
                name = self.plan.encoder.name
                self.fail(Fault(Blame.ENCODER, f"encoder {name} hung when {when}"))
            finally:
                told.cancel()

    def fail(self, fault: Fault) -> None:
        """Something is wrong with it. Only the first fault counts."""
        if not self._over.done():
            self._end()
            self._on_fault(fault)

    def _end(self) -> None:
        if not self._over.done():
            self._over.set_result(None)

    def draw(self) -> str:
        """The pipeline as a DOT graph."""
        text = Gst.debug_bin_to_dot_data(self._parts.pipeline, Gst.DebugGraphDetails.ALL)
        return str(text)

    # --- on the loop, called back ---

    def _read_bus(self) -> None:
        while (message := self._bus.pop_filtered(_INTERESTING)) is not None:
            if message.type == Gst.MessageType.ERROR:
                _log.debug("%s: %s", message.src.get_path_string(), message.parse_error())
                self.fail(faults.from_message(message, self._parts, self.plan))
            elif message.type == Gst.MessageType.WARNING:
                _log.warning("%s: %s", message.src.get_path_string(), message.parse_warning()[0].message)
            else:
                self.fail(faults.ended(self.plan))

    def _first_picture(self) -> None:
        if not self._over.done():
            self._on_first_picture()

    def _loop_failed(self) -> None:
        self.fail(faults.ended(self.plan))

    def _request_key_frame(self) -> None:
        """For a viewer that joined. While one request is still under way, its key frame serves both."""
        if self._over.done():
            return  # A viewer that joined a listener that is being stopped.
        if self._key_frame is None or self._key_frame.done():
            element, sink_pad = self._parts.encoder, self._parts.sink.get_static_pad("sink")
            call = partial(properties.request_key_frame, element, self.plan.encoder, sink_pad)
            self._key_frame = asyncio.create_task(
                self._tell_encoder(call, "it was asked for a key frame"), name="key frame"
            )

    async def _supervise(self) -> None:
        """Looks at the counters ten times a second until the pipeline is stopped."""
        timeouts = self._timeouts
        watchdogs = Watchdogs(
            time.monotonic(),
            first_frame_s=timeouts.start_s,
            source_s=timeouts.source_silence_s,
            encoder_s=timeouts.encoder_silence_s,
        )
        reading = statistics.read(self._framing, self._parts.sink)
        while True:
            await asyncio.sleep(_LOOK_EVERY_S)
            now = time.monotonic()
            silent = watchdogs.look(self._parts.rate.get_property("in"), self._framing.pictures, now)
            if silent:
                self.fail(faults.from_silence(silent, watchdogs.silence_s(silent, now), self.plan))
                return
            if now - reading.at >= MEASURE_EVERY_S:
                reading = self._measure(reading)

    def _measure(self, before: statistics.Reading) -> statistics.Reading:
        now = statistics.read(self._framing, self._parts.sink)
        self.measurement = statistics.measure(before, now, self._framing.last_picture_at)
        if self._controller and self.plan.encoder.spelling.live_bitrate:
            self._follow(self._controller, statistics.link_report(before, now))
        self._on_measured()
        return now

    def _follow(self, controller: BitrateController, link: statistics.LinkReport | None) -> None:
        if self._new_bitrate and not self._new_bitrate.done():
            return  # First the encoder has to take the last one.
        decision = controller.decide(link, time.monotonic())
        if decision.bitrate_kbps == self.bitrate_kbps:
            self.bitrate_reason = decision.reason
        else:
            self._new_bitrate = asyncio.create_task(self._set_bitrate(decision), name="bit rate")

    async def _set_bitrate(self, decision: Decision) -> None:
        _log.info("bit rate: %s", decision.reason)
        encoder, plan = self._parts.encoder, self.plan

        def change() -> None:
            if plan is self.plan:  # Not another profile meanwhile: its figures count.
                properties.set_bitrate_live(encoder, plan.encoder, decision.bitrate_kbps, plan.gop_frames)

        await self._tell_encoder(change, "its bit rate was changed")
        if plan is self.plan:
            self.bitrate_kbps, self.bitrate_reason = decision.bitrate_kbps, decision.reason

    async def _stop_watching(self) -> None:
        self._loop.remove_reader(self._bus_fd)
        for task in (self._watch, self._key_frame, self._new_bitrate):
            if task:
                task.cancel()
                with suppress(asyncio.CancelledError):
                    await task


def _to_null(element: Any) -> None:
    # Locked, so that nothing of the pipeline starts it again meanwhile.
    element.set_locked_state(True)
    element.set_state(Gst.State.NULL)
