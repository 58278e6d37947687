"""One running pipeline, controlled from the event loop: start, watch, adjust, stop.

supervisor.py has the table of what can fail and what follows. GStreamer's threads enter Python in four
places only (framing.py, keyframe_gate.py, file_loop.py, access_units.py), at most frame rates for no frame
unless it is recorded, and schedule calls on the loop. Every call that may block in a driver (state changes,
properties of a playing encoder, requests for key frames) runs in a thread of its own with a deadline.
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

from common.gst import Gst, stop, stop_element
from common.private_files import make_own_directory
from preview.encoders import properties
from preview.pipeline import builder, capture_clock, faults, statistics
from preview.pipeline.access_units import AccessUnits
from preview.pipeline.adaptive import BitrateController, Decision, Sample
from preview.pipeline.events import AccessUnit, Blame, Fault, HungError, PipelineEvents
from preview.pipeline.file_loop import FileLoop
from preview.pipeline.framing import Framing
from preview.pipeline.keyframe_gate import KeyframeGate
from preview.pipeline.listener import Listener
from preview.pipeline.plan import Plan
from preview.pipeline.threads import in_thread
from preview.pipeline.watchdogs import Watchdogs
from preview.values import Measurement, Profile, StreamState

_log = logging.getLogger(__name__)

_CHECK_INTERVAL_S: Final = 0.2
_WINDOW_S: Final = 0.5
"""Window of the statistics, rounded up to a multiple of _CHECK_INTERVAL_S."""
_DRIVER_DEADLINE_S: Final = 2.0
"""For a call into the encoder's driver while it runs."""
_PICTURE_AGE_COUNTS_S: Final = 3.0
"""As the gateway counts a viewer's report."""
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
        self._bitrate = Decision(plan.target.bitrate_kbps)
        self._timeouts = plan.settings.timeouts
        self._events = events
        self._controller = BitrateController(plan.target.bitrate_kbps, plan.target.floor_kbps)
        loop = self._loop = asyncio.get_running_loop()
        parts = self._parts = builder.build(plan)
        self._framing = Framing(parts, self._first_frame, self._source_ended, plan.target.fps)
        self._listener: Listener | None = None
        self._access_units: AccessUnits | None = None
        self._keyframe_gate = KeyframeGate(parts, self._request_key_frame)
        self._file_loop = FileLoop(parts, self._source_ended) if plan.source.loops else None
        self._bus = parts.pipeline.get_bus()
        self._bus_fd = self._bus.get_pollfd().fd
        self._tasks: dict[str, asyncio.Task[None]] = {}
        """The newest task of each kind."""
        self._picture_age_ms = 0
        self._picture_age_at = float("-inf")
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
        self._bitrate = Decision(target.bitrate_kbps)
        self._controller.retarget(target.bitrate_kbps, self._floor_kbps)
        apply_target, framing = self._parts.apply_target, self._framing

        def apply() -> None:
            apply_target(plan)
            framing.set_rate(target.fps)

        await self._call_driver(apply, "the profile was changed")

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
            plan = replace(self.plan, passphrase=passphrase)
            await self._open_listener(plan)
            self.plan = plan

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
        """Takes the age of the oldest picture that a viewer shows; it counts for `_PICTURE_AGE_COUNTS_S`."""
        self._picture_age_ms, self._picture_age_at = age_ms, time.monotonic()

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
        if self._file_loop:
            self._file_loop.detach()
            self._file_loop = None
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
        """Lower limit of the adaptive bit rate: a recording may have one of its own."""
        profile_kbps = self.plan.target.floor_kbps
        if self._access_units is None:
            return profile_kbps
        return max(profile_kbps, self.plan.settings.video_tap.floor_kbps)

    # --- events ---

    def _first_frame(self) -> None:
        if not self._ended.done():
            self._events.first_frame()

    def _listener_failed(self, fault: Fault) -> None:
        if not self._ended.done() and not self._events.listener_failed(fault):
            self._fail(fault)

    def _source_ended(self) -> None:
        self._fail(faults.of(Blame.SOURCE, "has ended", self.plan))

    def _fail(self, fault: Fault) -> None:
        if not self._ended.done():
            self._ended.set_result(None)
            self._events.failed(fault)

    def _read_bus(self) -> None:
        while (message := self._bus.pop_filtered(_MESSAGES)) is not None:
            if message.type == Gst.MessageType.ERROR:
                _log.debug("%s: %s", message.src.get_path_string(), message.parse_error())
                self._fail(faults.from_message(message, self._parts, self.plan))
            else:
                _log.warning("%s: %s", message.src.get_path_string(), message.parse_warning()[0].message)

    async def _watch(self) -> None:
        """Checks the watchdogs every 0.2 s and measures every window, until the pipeline fails or stops."""
        watchdogs = Watchdogs(time.monotonic(), self._timeouts)
        reading = statistics.read(self._framing, self._listener)
        while True:
            await asyncio.sleep(_CHECK_INTERVAL_S)
            now = time.monotonic()
            silent = watchdogs.check(self._parts.rate.get_property("in"), self._framing.frames, now)
            if silent:
                self._fail(faults.of(*silent, self.plan))
                return
            if now - reading.at >= _WINDOW_S or self._is_overwhelmed(now):
                reading = self._measure(reading)

    def _is_overwhelmed(self, now: float) -> bool:
        """Whether the bit rate can't wait for the end of the window."""
        if not self.plan.settings.adaptive.enabled or self._is_pending("bit rate"):
            return False
        return self._controller.is_overwhelmed(statistics.read(self._framing, self._listener).rtts_ms, now)

    def _measure(self, before: statistics.Reading) -> statistics.Reading:
        now = statistics.read(self._framing, self._listener)
        self.measurement = statistics.measure(before, now)
        if self.plan.settings.adaptive.enabled:
            links = statistics.measured_links(before, now)
            self._adapt_bitrate(Sample(self.measurement.bitrate_kbps, links, self._picture_age(now.at)))
        self._events.measured(self._listener.take_refused() if self._listener else 0)
        return now

    def _picture_age(self, now: float) -> float | None:
        """Returns the newest reported age; None where no viewer has reported one lately."""
        return self._picture_age_ms if now - self._picture_age_at < _PICTURE_AGE_COUNTS_S else None

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
