"""One running pipeline, controlled from the event loop: start, watch, adjust, stop.

supervisor.py has the table of what can fail and what follows. GStreamer's threads enter Python in few places
only (framing.py, keyframe_gate.py, file_loop.py, source_end.py, access_units.py, camera_switch.py), at most
frame rates for no frame unless it is recorded, and schedule calls on the loop. Every call that may block in a
driver (state changes, properties of a playing encoder, requests for key frames) runs in a thread of its own
with a deadline.
"""

import asyncio
import logging
import time
from collections.abc import Callable, Coroutine
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from common.errors import UserError
from common.gst import Gst, stop, stop_element
from common.private_files import make_own_directory
from preview.encoders import properties
from preview.pipeline import builder, capture_clock, faults, statistics
from preview.pipeline.access_units import AccessUnits
from preview.pipeline.adaptive import BitrateController, Decision, Sample
from preview.pipeline.camera_switch import CameraFailedError, Candidate, dispose
from preview.pipeline.events import AccessUnit, Blame, Fault, HungError, PipelineEvents
from preview.pipeline.file_loop import FileLoop
from preview.pipeline.framing import Framing
from preview.pipeline.keyframe_gate import KeyframeGate
from preview.pipeline.listener import Listener
from preview.pipeline.picture_age import PictureAge
from preview.pipeline.plan import Plan
from preview.pipeline.source_end import SourceEnd
from preview.pipeline.sources import SourcePlan
from preview.pipeline.threads import in_thread
from preview.pipeline.watchdogs import Watchdogs
from preview.values import Measurement, Profile, StreamState

_log = logging.getLogger(__name__)

_CHECK_INTERVAL_S: Final = 0.2
_WINDOW_S: Final = 0.5
"""Window of the statistics, rounded up to a multiple of _CHECK_INTERVAL_S."""
_DRIVER_DEADLINE_S: Final = 2.0
"""For a call into the encoder's driver while it runs."""
_GRAPH_DEADLINE_S: Final = 0.3
_MESSAGES: Final = Gst.MessageType.ERROR | Gst.MessageType.WARNING


class Runner:
    """One pipeline from building to teardown; created and used on the loop.

    Args:
        plan: what to build.
        events: receives the first frame, the first fault and new statistics.

    Raises:
        UserError: the pipeline can't be built.
    """

    def __init__(self, plan: Plan, events: PipelineEvents) -> None:
        self.plan = plan
        self.measurement: Measurement | None = None
        self._timeouts = plan.settings.timeouts
        self._events = events
        self._access_units: AccessUnits | None = None
        self._controller = BitrateController(plan.target.bitrate_kbps, self._floor_kbps)
        self._bitrate = self._controller.decision
        loop = self._loop = asyncio.get_running_loop()
        parts = self._parts = builder.build(plan, self._bitrate.bitrate_kbps)
        self._framing = Framing(parts, self._first_frame, self._source_ended, plan.target.fps)
        self._listener: Listener | None = None
        self._keyframe_gate = KeyframeGate(parts, self._request_key_frame)
        self._file_loop: FileLoop | None = None
        self._attach_source()
        self._candidate: Candidate | None = None
        self._live: Candidate | None = None
        """The camera that took over last."""
        """A camera that is being started beside the live one."""
        self._begun = False
        """Whether the first frame has come."""
        self._lost: Fault | None = None
        """Of the live camera, while the pipeline goes on because another one is being started."""
        self._showing: SourcePlan | None = None
        """What is being started, or about to be."""
        self._left_behind: list[str] = []
        """Labels of cameras that hung when they were stopped."""
        self._bus = parts.pipeline.get_bus()
        self._bus_fd = self._bus.get_pollfd().fd
        self._tasks: dict[str, asyncio.Task[None]] = {}
        """The newest task of each kind."""
        self._picture_age = PictureAge()
        self._driver_lock = asyncio.Lock()
        self._ended: asyncio.Future[None] = loop.create_future()
        """Done when the pipeline has failed or is being stopped; no event is reported from then on."""

    @property
    def stream(self) -> StreamState:
        """Parameters of the stream being served."""
        plan, bitrate = self.plan, self._bitrate
        encrypted = bool(plan.passphrase)
        return StreamState(plan.target, bitrate.bitrate_kbps, bitrate.reason, plan.encoder.codec, encrypted)

    async def start(self) -> None:
        """Starts the pipeline. Failures are reported as events, also after this has returned."""
        self._loop.add_reader(self._bus_fd, self._read_bus)
        if self.plan.passphrase is not None:
            await self._open_listener(self.plan)
        if self._ended.done():
            return
        pipeline = self._parts.pipeline
        try:
            start = partial(capture_clock.play, pipeline, self._parts.source)
            outcome = await in_thread(start, self._timeouts.start_s)
        except TimeoutError:
            self._fail(faults.blocked(self._parts, self.plan, self._timeouts.start_s))
            return
        self._read_bus()
        if outcome == Gst.StateChangeReturn.FAILURE:
            # Counts only if no element posted an error.
            self._fail(faults.of(Blame.ENCODER, "could not be started and gave no reason", self.plan))
            return
        self._spawn("watch", self._watch())

    async def switch(self, profile: Profile) -> None:
        """Switches to another profile; viewers stay connected."""
        plan = self.plan = replace(self.plan, profile=profile)
        target = plan.target
        self._controller.retarget(target.bitrate_kbps, self._floor_kbps)
        bitrate = self._bitrate = self._controller.decision
        framing = self._framing

        def apply() -> None:
            # Of this moment: the camera may have changed while the driver was busy.
            parts = self._parts
            builder.apply_source_target(parts.source, plan)
            parts.apply_target(plan, bitrate.bitrate_kbps)
            framing.set_rate(target.fps)

        await self._call_driver(apply, "the profile was changed")

    @property
    def live_camera(self) -> str | None:
        """Name of the camera whose frames are served; None while it has failed."""
        return None if self._lost else self.plan.source.camera

    @property
    def starting_camera(self) -> str | None:
        """Name of the camera that is being started to become the live one; None if none is."""
        return self._showing.camera if self._showing else None

    def show(self, source: SourcePlan | None) -> None:
        """Starts another camera, which becomes the live one with its first frame; reported as an event.

        Args:
            source: the newest one counts: a camera that is being started is stopped first. None: it is
                stopped, and the live one stays.
        """
        self._showing = source
        self._spawn("camera", self._show(source, self._tasks.get("camera")))

    async def listen(self, passphrase: str | None) -> None:
        """Replaces the listener by one with another passphrase, None: by none; the encoder goes on.

        Raises:
            HungError: the old one hangs.
        """
        free = await self._close_listener()
        try:
            await in_thread(free, self._timeouts.stop_s)
        except TimeoutError as error:
            raise HungError("the SRT listener hung when it was freed") from error
        self.plan = replace(self.plan, passphrase=None)
        if passphrase is not None and not self._ended.done():
            await self._open_listener(replace(self.plan, passphrase=passphrase))
            # The camera may have changed meanwhile.
            self.plan = replace(self.plan, passphrase=passphrase)

    def record(self, take: Callable[[AccessUnit], None] | None) -> None:
        """Hands each access unit to a recording from now on; None: to none."""
        if self._access_units:
            self._access_units.close()
        self._access_units = None
        if take and not self._ended.done():
            self._access_units = AccessUnits(self._parts.encoded_pad, take)
        self._controller.set_floor(self._floor_kbps)

    def request_key_frame(self, newest_pts: int | None) -> bool:
        """Requests a key frame for a viewer that lost a picture; see `KeyframeGate.request_after_loss`."""
        return not self._ended.done() and self._keyframe_gate.request_after_loss(newest_pts)

    def take_picture_age(self, age_ms: int) -> None:
        """Takes the age of the oldest picture that a viewer shows; see `PictureAge`."""
        now = time.monotonic()
        self._picture_age.note_newest(self._framing.last_frame_age_ms, now)
        self._picture_age.take(age_ms, now)

    async def stop(self) -> "asyncio.Task[bool]":
        """Tears the pipeline down, each part with a deadline.

        First the listener, which frees its port and disconnects the viewers, then the source, which frees its
        device: so the next pipeline can start even if the rest hangs.

        Returns:
            Teardown of the rest, the encoder among it: True when it has finished, False when it hangs.

        Raises:
            HungError: the listener or the source hangs.
        """
        if not self._ended.done():
            self._ended.set_result(None)  # Errors from here on are caused by the teardown.
        self._loop.remove_reader(self._bus_fd)
        for task in self._tasks.values():
            task.cancel()
        for task in self._tasks.values():
            with suppress(asyncio.CancelledError):
                await task
        deadline_s = self._timeouts.stop_s
        free_listener = await self._close_listener()
        try:
            await in_thread(partial(stop_element, self._parts.source), deadline_s)
        except TimeoutError as error:
            raise HungError(f"{self.plan.source.label} hung when it was stopped") from error
        if self._left_behind:
            raise HungError(f"{self._left_behind[0]} hung when it was stopped")
        work = _stop_pipeline(free_listener, self._release(), self._framing.close, deadline_s)
        return asyncio.create_task(work, name="stop the encoder")

    async def write_graph(self, path: Path) -> None:
        """Writes pipeline and listener as DOT graphs; logs a warning where that fails or takes too long."""
        pipelines = [self._parts.pipeline, *([self._listener.pipeline] if self._listener else [])]

        def write() -> None:
            make_own_directory(path.parent)
            everything = Gst.DebugGraphDetails.ALL
            graphs = [Gst.debug_bin_to_dot_data(each, everything) for each in pipelines]
            path.write_text("".join(graphs), encoding="utf-8")

        try:
            await in_thread(write, _GRAPH_DEADLINE_S)
        except (TimeoutError, OSError) as error:
            _log.warning("no graph of the failed pipeline in %s: %s", path, error)

    def _release(self) -> list[Any]:
        """Drops every reference to the pipeline; the returned list has the last one."""
        self.record(None)
        self._keyframe_gate.detach()
        self._framing.detach()
        self._detach_source()
        last = [self._parts.pipeline]
        del self._parts, self._bus
        return last

    async def _open_listener(self, plan: Plan) -> None:
        """Starts the listener of a plan; a failure is reported as an event."""
        listener = self._listener = Listener(plan, self._listener_failed)
        self._keyframe_gate.watch(listener.sink)
        await listener.start(self._framing.send_to)

    async def _close_listener(self) -> Callable[[], None]:
        """Stops the listener, if there is one.

        Returns:
            Frees the rest of it; may block.

        Raises:
            HungError: it hangs.
        """
        self._framing.send_to_nobody()
        self._keyframe_gate.unwatch()
        listener, self._listener = self._listener, None
        return await listener.stop() if listener else lambda: None

    @property
    def _floor_kbps(self) -> int:
        """Lower limit of the bit rate: the target if it is fixed; a recording may have one of its own."""
        target, settings = self.plan.target, self.plan.settings
        if not settings.adaptive.enabled:
            return target.bitrate_kbps
        if self._access_units is None:
            return target.floor_kbps
        return max(target.floor_kbps, settings.video_tap.floor_kbps)

    # --- events ---

    def _first_frame(self) -> None:
        if not self._ended.done():
            self._begun = True
            self._events.first_frame()

    def _listener_failed(self, fault: Fault) -> None:
        if not self._ended.done() and not self._events.listener_failed(fault):
            self._fail(fault)

    def _source_ended(self) -> None:
        if not self._ended.done():
            self._read_bus()  # An error comes with an end, and says why.
            self._fail(faults.of(Blame.SOURCE, "has ended", self.plan))

    def _fail(self, fault: Fault, *, final: bool = False) -> None:
        """Reports the first fault, unless it is of the live camera and another one takes its place."""
        if self._ended.done() or (not final and fault.blame is Blame.SOURCE and self._replaces(fault)):
            return
        self._ended.set_result(None)
        self._events.failed(fault)

    def _replaces(self, fault: Fault) -> bool:
        """Whether the pipeline goes on without its live camera."""
        if not self._begun:
            return False
        if self._lost is None:
            self._lost = fault
            return self._events.camera_failed(self.plan.source.camera, fault)
        return True

    def _read_bus(self) -> None:
        while not self._ended.done() and (message := self._bus.pop_filtered(_MESSAGES)) is not None:
            if message.type == Gst.MessageType.ERROR:
                _log.debug("%s: %s", message.src.get_path_string(), message.parse_error())
                self._take_error(message)
            else:
                _log.warning("%s: %s", message.src.get_path_string(), message.parse_warning()[0].message)

    def _take_error(self, message: Any) -> None:
        culprit, candidate = message.src, self._candidate
        if candidate and faults.is_within(culprit, candidate.source):
            candidate.fail(f"failed: {faults.reason(message)}")
        elif not self._is_old_camera(culprit):
            self._fail(faults.from_message(message, self._parts, self.plan))

    def _is_old_camera(self, culprit: Any) -> bool:
        """Whether an element is of a camera that is being stopped; its errors are of no interest any more."""
        parts, top = self._parts, culprit
        while top is not None and top is not parts.pipeline and top.get_parent() is not parts.pipeline:
            top = top.get_parent()  # None once it has been removed.
        return top not in (parts.pipeline, parts.source, parts.body)

    async def _watch(self) -> None:
        """Checks the watchdogs every 0.2 s and measures every window, until the pipeline fails or stops."""
        watchdogs, held_back = Watchdogs(time.monotonic(), self._timeouts), 0
        reading = statistics.read(self._framing, self._listener)
        while True:
            await asyncio.sleep(_CHECK_INTERVAL_S)
            now = time.monotonic()
            if self._live and self._live.held_back != held_back:
                held_back = self._live.held_back
                watchdogs = Watchdogs(now, self._timeouts)  # It delivers, and its time has not come yet.
            silent = watchdogs.check(self._parts.rate.get_property("in"), self._framing.frames, now)
            if silent and not self._lost:
                self._fail(faults.of(*silent, self.plan))
            if self._ended.done():
                return
            if self._lost:
                watchdogs = Watchdogs(now, self._timeouts)  # The next camera's time begins when it is live.
            self._picture_age.note_newest(self._framing.last_frame_age_ms, now)
            if now - reading.at >= _WINDOW_S or self._is_overwhelmed(now):
                reading = self._measure(reading)

    def _is_overwhelmed(self, now: float) -> bool:
        """Whether the bit rate can't wait for the end of the window."""
        if self._is_pending("bit rate"):
            return False
        return self._controller.is_overwhelmed(statistics.read(self._framing, self._listener).rtts_ms, now)

    def _measure(self, before: statistics.Reading) -> statistics.Reading:
        now = statistics.read(self._framing, self._listener)
        self.measurement = statistics.measure(before, now)
        links = statistics.measured_links(before, now)
        age_ms = self._picture_age.counting(now.at)
        self._adapt_bitrate(Sample(self.measurement.bitrate_kbps, links, age_ms))
        self._events.measured(self._listener.take_refused() if self._listener else 0)
        return now

    # --- cameras ---

    async def _show(self, source: SourcePlan | None, before: "asyncio.Task[None] | None") -> None:
        if before and not before.done():
            before.cancel()
            await _finished(before)
        if source is None:
            return
        try:
            candidate = self._candidate = Candidate(self._parts, replace(self.plan, source=source))
            try:
                await candidate.deliver(self._timeouts.start_s, self._read_bus)
                await _uninterrupted(self._take_over(candidate, source))
            finally:
                self._candidate = None
                if self._parts.source is not candidate.source:
                    await _uninterrupted(self._leave(candidate.stop(self._timeouts.stop_s), source))
        except UserError as error:
            self._show_failed(source, Fault(Blame.SOURCE, str(error)))
        except CameraFailedError as error:
            plan = replace(self.plan, source=source)
            self._show_failed(source, faults.of(Blame.SOURCE, str(error), plan))

    async def _take_over(self, candidate: Candidate, source: SourcePlan) -> None:
        """Makes a camera that delivers the live one, and stops the old one."""
        async with self._driver_lock:
            if self._ended.done():
                return
            old, before = self._parts.source, self.plan.source
            try:
                await candidate.take_over(old, replace(self.plan, source=source))
            except TimeoutError:
                self._fail(faults.of(Blame.OTHER, "hung when the camera was changed", self.plan))
                return
            self._detach_source()
            self._parts = replace(self._parts, source=candidate.source)
            self.plan = replace(self.plan, source=source)
            self._live, self._candidate, self._lost = candidate, None, None
            self._attach_source()
        self._request_key_frame()
        if self._showing is source:
            self._showing = None
        if not self._ended.done():
            self._events.camera_shown(source.camera)
        await self._leave(dispose(self._parts.pipeline, old, self._timeouts.stop_s), before)

    def _show_failed(self, source: SourcePlan, fault: Fault) -> None:
        if self._ended.done():
            return
        if self._showing is source:
            self._showing = None
        goes_on = self._events.camera_failed(source.camera, fault)
        if self._lost and not goes_on:
            self._fail(self._lost, final=True)

    async def _leave(self, stopping: Coroutine[Any, Any, None], source: SourcePlan) -> None:
        """Waits until a camera has stopped; one that hangs is left behind until the pipeline is stopped."""
        try:
            await stopping
        except TimeoutError:
            _log.error("%s hung when it was stopped", source.label)
            self._left_behind.append(source.label)

    def _attach_source(self) -> None:
        """Watches the end of the live camera."""
        source = self._parts.source
        self._source_end = SourceEnd(source, self._source_ended)
        if self.plan.source.loops:
            self._file_loop = FileLoop(self._parts.pipeline, source, self._source_ended)

    def _detach_source(self) -> None:
        self._source_end.detach()
        if self._file_loop:
            self._file_loop.detach()
            self._file_loop = None

    # --- calls into the encoder's driver ---

    def _request_key_frame(self) -> None:
        """Requests a key frame for a new viewer; one that is already requested serves both."""
        if self._ended.done() or self._is_pending("key frame"):
            return
        muxed_pad = self._parts.pipe_in.get_static_pad("sink")
        call = partial(properties.request_key_frame, self._parts.encoder, self.plan.encoder, muxed_pad)
        self._spawn("key frame", self._call_driver(call, "it was asked for a key frame"))

    def _adapt_bitrate(self, sample: Sample) -> None:
        if self._is_pending("bit rate"):
            return  # The encoder has yet to apply the previous one.
        decision = self._controller.decide(sample, time.monotonic())
        if decision.bitrate_kbps == self._bitrate.bitrate_kbps:
            self._bitrate = decision
        else:
            self._spawn("bit rate", self._set_bitrate(decision))

    async def _set_bitrate(self, decision: Decision) -> None:
        _log.info("bit rate: %s", decision.reason)
        encoder, plan = self._parts.encoder, self.plan

        def apply() -> None:
            if plan is self.plan:  # Otherwise another profile was set in the meantime: its bit rate applies.
                properties.set_bitrate(encoder, plan.encoder, decision.bitrate_kbps, plan.gop_frames)

        await self._call_driver(apply, "its bit rate was changed")
        if plan is self.plan:
            self._bitrate = decision

    def _spawn(self, name: str, work: Coroutine[Any, Any, None]) -> None:
        self._tasks[name] = asyncio.create_task(work, name=name)

    def _is_pending(self, name: str) -> bool:
        return name in self._tasks and not self._tasks[name].done()

    async def _call_driver(self, call: Callable[[], None], when: str) -> None:
        """Makes a call that may block in the encoder's driver: one at a time, none after the end."""
        async with self._driver_lock:
            if self._ended.done():
                return
            calling = asyncio.create_task(in_thread(call, _DRIVER_DEADLINE_S), name=f"encoder: {when}")
            try:
                # Does not delay the reaction to another failure in the meantime.
                await asyncio.wait((calling, self._ended), return_when=asyncio.FIRST_COMPLETED)
                if calling.done():
                    calling.result()
            except TimeoutError:
                self._fail(faults.of(Blame.ENCODER, f"hung when {when}", self.plan))
            finally:
                calling.cancel()


async def _uninterrupted(work: Coroutine[Any, Any, None]) -> None:
    """Awaits what must not be left half done, to its end even if it is cancelled meanwhile."""
    task = asyncio.create_task(work)
    await _finished(task)
    task.result()


async def _finished(task: "asyncio.Task[None]") -> None:
    """Waits for the end of a task, even if the wait is cancelled: the task takes a bounded time."""
    try:
        await asyncio.wait({task})
    except asyncio.CancelledError:
        await asyncio.wait({task})
        raise


async def _stop_pipeline(
    free_listener: Callable[[], None],
    last_reference: list[Any],
    close_pipe: Callable[[], None],
    deadline_s: float,
) -> bool:
    """Frees the listener, stops and frees its pipeline; False when that does not finish in time."""

    def stop_and_free() -> None:
        free_listener()
        stop(last_reference[0])
        # Freed here, in this thread: that may take its time.
        last_reference.clear()
        close_pipe()

    try:
        await in_thread(stop_and_free, deadline_s)
    except TimeoutError:
        return False
    return True
