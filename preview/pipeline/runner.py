"""One running pipeline, controlled from the event loop: start, watch, adjust, stop.

preview/supervisor has the table of what can fail and what follows. GStreamer's threads enter Python in few
places only (framing.py, keyframe_gate.py, file_loop.py, source_end.py, access_units.py, camera_switch.py,
camera_decoder.py, viewer_limit.py). There they look at the stream, and schedule calls on the loop for what
follows; for a single frame they do so only while it is recorded or cameras change. viewer_limit.py decides on
SRT's thread, under a lock: a handshake waits for its answer.

Every call that may block in a driver (state changes, properties of a playing encoder, requests for key
frames) runs in a thread of its own with a deadline.
"""

import asyncio
import logging
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from common.gst import Gst, stop, stop_element
from common.private_files import make_own_directory
from common.tasks import end
from preview.pipeline import builder, capture_clock, faults, statistics
from preview.pipeline.access_units import AccessUnits
from preview.pipeline.adaptive import BitrateController, Sample
from preview.pipeline.encoder_driver import EncoderDriver
from preview.pipeline.events import AccessUnit, Blame, Fault, HungError, PipelineEvents
from preview.pipeline.framing import Framing
from preview.pipeline.keyframe_gate import KeyframeGate
from preview.pipeline.listener import Listener
from preview.pipeline.live_camera import LiveCamera
from preview.pipeline.picture_age import PictureAge
from preview.pipeline.plan import Plan
from preview.pipeline.running import Running
from preview.pipeline.sources import SourcePlan
from preview.pipeline.threads import in_thread
from preview.pipeline.watchdogs import Watchdogs
from preview.state.values import Measurement, Profile, StreamState

_log = logging.getLogger(__name__)

_CHECK_INTERVAL_S: Final = 0.2
_WINDOW_S: Final = 0.5
"""Window of the statistics, rounded up to a multiple of _CHECK_INTERVAL_S."""
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
        self.measurement: Measurement | None = None
        self._events = events
        self._timeouts = plan.settings.timeouts
        self._loop = asyncio.get_running_loop()
        self._access_units: AccessUnits | None = None
        self._controller = BitrateController(plan.target.bitrate_kbps, _floor_kbps(plan, recorded=False))
        parts = builder.build(plan)
        self._running = Running(plan, parts, self._loop.create_future())
        self._framing = Framing(parts, self._first_frame, self._source_ended, plan.target.fps)
        self._driver = EncoderDriver(self._running, self._controller.decision, self._fail)
        self._camera = LiveCamera(
            self._running,
            self._driver,
            events,
            on_end=self._source_ended,
            fail=self._end,
            read_bus=self._read_bus,
        )
        self._listener: Listener | None = None
        self._keyframe_gate = KeyframeGate(parts, self._driver.request_key_frame, self._viewer_connected)
        self._begun = False
        """Whether the first frame has come."""
        self._bus = parts.pipeline.get_bus()
        self._bus_fd = self._bus.get_pollfd().fd
        self._watching: asyncio.Task[None] | None = None
        self._picture_age = PictureAge()

    @property
    def plan(self) -> Plan:
        """What is in effect."""
        return self._running.plan

    @property
    def stream(self) -> StreamState:
        """Parameters of the stream being served."""
        plan, bitrate = self.plan, self._driver.bitrate
        encrypted = bool(plan.passphrase)
        return StreamState(plan.target, bitrate.bitrate_kbps, bitrate.reason, plan.encoder.codec, encrypted)

    async def start(self) -> None:
        """Starts the pipeline. Failures are reported as events, also after this has returned."""
        self._loop.add_reader(self._bus_fd, self._read_bus)
        if self.plan.passphrase is not None:
            await self._open_listener(self.plan)
        if self._running.has_ended:
            return
        parts = self._running.parts
        try:
            start = partial(capture_clock.play, parts.pipeline, parts.source)
            outcome = await in_thread(start, self._timeouts.start_s)
        except TimeoutError:
            self._fail(faults.blocked(parts, self.plan, self._timeouts.start_s))
            return
        self._read_bus()
        if outcome == Gst.StateChangeReturn.FAILURE:
            # Counts only if no element posted an error.
            self._fail(faults.of(Blame.ENCODER, "could not be started and gave no reason", self.plan))
            return
        self._watching = asyncio.create_task(self._watch(), name="watch")

    async def switch(self, profile: Profile) -> None:
        """Switches to another profile; viewers stay connected."""
        plan = self._running.plan = replace(self.plan, profile=profile)
        target = plan.target
        self._controller.retarget(target.bitrate_kbps, self._floor_kbps)
        bitrate = self._driver.bitrate = self._controller.decision
        running, framing = self._running, self._framing

        def apply() -> None:
            # Of this moment: the camera may have changed while the driver was busy.
            parts = running.parts
            builder.apply_source_target(parts.source, plan)
            parts.apply_target(plan, bitrate.bitrate_kbps)
            framing.set_rate(target.fps)

        await self._driver.call(apply, "the profile was changed")

    @property
    def live_camera(self) -> str | None:
        """Name of the camera whose frames are served; None while it has failed."""
        return self._camera.name

    @property
    def starting_camera(self) -> str | None:
        """Name of the camera that is being started to become the live one; None if none is."""
        return self._camera.starting

    def show(self, source: SourcePlan | None) -> None:
        """Starts another camera, None: none; see `LiveCamera.show`."""
        self._camera.show(source)

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
        self._running.plan = replace(self.plan, passphrase=None)
        if passphrase is not None and not self._running.has_ended:
            await self._open_listener(replace(self.plan, passphrase=passphrase))
            # The camera may have changed meanwhile.
            self._running.plan = replace(self.plan, passphrase=passphrase)

    def record(self, take: Callable[[AccessUnit], None] | None) -> None:
        """Hands each access unit to a recording from now on; None: to none."""
        if self._access_units:
            self._access_units.close()
        self._access_units = None
        if take and not self._running.has_ended:
            self._access_units = AccessUnits(self._running.parts.encoded_pad, take)
        self._controller.set_floor(self._floor_kbps)

    def request_key_frame(self, newest_pts: int | None) -> bool:
        """Requests a key frame for a viewer that lost a picture; see `KeyframeGate.request_after_loss`."""
        return not self._running.has_ended and self._keyframe_gate.request_after_loss(newest_pts)

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
        if not self._running.has_ended:
            self._running.ended.set_result(None)  # Errors from here on are caused by the teardown.
        self._loop.remove_reader(self._bus_fd)
        await self._camera.close()
        await self._driver.close()
        if self._watching:
            await end([self._watching])
        deadline_s = self._timeouts.stop_s
        free_listener = await self._close_listener()
        try:
            await in_thread(partial(stop_element, self._running.parts.source), deadline_s)
        except TimeoutError as error:
            raise HungError(f"{self.plan.source.label} hung when it was stopped") from error
        self._camera.check_left_behind()
        work = _stop_pipeline(free_listener, self._release(), self._framing.close, deadline_s)
        return asyncio.create_task(work, name="stop the encoder")

    async def write_graph(self, path: Path) -> None:
        """Writes pipeline and listener as DOT graphs; logs a warning where that fails or takes too long."""
        pipelines = [self._running.parts.pipeline, *([self._listener.pipeline] if self._listener else [])]

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
        self._camera.release()
        last = [self._running.parts.pipeline]
        del self._running.parts, self._bus
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
        self._framing.discard()
        self._keyframe_gate.unwatch()
        listener, self._listener = self._listener, None
        return await listener.stop() if listener else lambda: None

    @property
    def _floor_kbps(self) -> int:
        return _floor_kbps(self.plan, recorded=self._access_units is not None)

    # --- events ---

    def _first_frame(self) -> None:
        if not self._running.has_ended:
            self._begun = True
            self._events.first_frame()

    def _viewer_connected(self) -> None:
        """Lowers the bit rate for a first viewer, before its key frame is made."""
        if not self._running.has_ended:
            self._driver.set_bitrate(self._controller.connect(time.monotonic()))

    def _listener_failed(self, fault: Fault) -> None:
        if not self._running.has_ended and not self._events.listener_failed(fault):
            self._fail(fault)

    def _source_ended(self) -> None:
        if not self._running.has_ended:
            self._read_bus()  # An error comes with an end, and says why.
            self._fail(faults.of(Blame.SOURCE, "has ended", self.plan))

    def _fail(self, fault: Fault) -> None:
        """Reports the first fault, unless it is of the live camera and another one takes its place."""
        if self._running.has_ended:
            return
        if not (self._begun and fault.blame is Blame.SOURCE and self._camera.survives(fault)):
            self._end(fault)

    def _end(self, fault: Fault) -> None:
        """Reports the first fault."""
        if not self._running.has_ended:
            self._running.ended.set_result(None)
            self._events.failed(fault)

    def _read_bus(self) -> None:
        while not self._running.has_ended and (message := self._bus.pop_filtered(_MESSAGES)) is not None:
            if message.type == Gst.MessageType.ERROR:
                _log.debug("%s: %s", message.src.get_path_string(), message.parse_error())
                self._take_error(message)
            else:
                _log.warning("%s: %s", message.src.get_path_string(), message.parse_warning()[0].message)

    def _take_error(self, message: Any) -> None:
        if not self._camera.take_error(message.src, faults.reason(message)):
            self._fail(faults.from_message(message, self._running.parts, self.plan))

    async def _watch(self) -> None:
        """Checks the watchdogs every 0.2 s and measures every window, until the pipeline fails or stops."""
        watchdogs, held_back = Watchdogs(time.monotonic(), self._timeouts), 0
        reading = statistics.read(self._framing, self._listener)
        while True:
            await asyncio.sleep(_CHECK_INTERVAL_S)
            now = time.monotonic()
            if self._camera.held_back != held_back:
                held_back = self._camera.held_back
                watchdogs = Watchdogs(now, self._timeouts)  # It delivers, and its time has not come yet.
            rate_in = self._running.parts.rate.get_property("in")
            limit_s = self._running.plan.source.silence_s
            silent = watchdogs.check(rate_in, self._framing.frames, now, limit_s)
            if silent and self._camera.name is not None:
                self._fail(faults.of(*silent, self.plan))
            if self._running.has_ended:
                return
            if self._camera.name is None:
                watchdogs = Watchdogs(now, self._timeouts)  # The next camera's time begins when it is live.
            self._picture_age.note_newest(self._framing.last_frame_age_ms, now)
            if now - reading.at >= _WINDOW_S or self._is_urgent(now):
                reading = self._measure(reading)

    def _is_urgent(self, now: float) -> bool:
        """Whether the bit rate can't wait for the end of the window."""
        if self._driver.sets_bitrate:
            return False
        return self._controller.is_urgent(statistics.read(self._framing, self._listener).rtts_ms, now)

    def _measure(self, before: statistics.Reading) -> statistics.Reading:
        now = statistics.read(self._framing, self._listener)
        self.measurement = statistics.measure(before, now)
        if not self._driver.sets_bitrate:  # Otherwise the encoder has yet to apply the previous one.
            links = statistics.measured_links(before, now)
            sample = Sample(self.measurement.bitrate_kbps, links, self._picture_age.counting(now.at))
            self._driver.set_bitrate(self._controller.decide(sample, now.at))
        self._events.measured(self._listener.take_refused() if self._listener else 0)
        return now


def _floor_kbps(plan: Plan, *, recorded: bool) -> int:
    """Returns the lower limit of the bit rate: the target if it is fixed; a recording may raise it."""
    target, settings = plan.target, plan.settings
    if not settings.adaptive.enabled:
        return target.bitrate_kbps
    return max(target.floor_kbps, settings.video_tap.floor_kbps if recorded else 0)


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
