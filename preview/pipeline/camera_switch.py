"""Another camera in a running pipeline: started beside the live one, and linked in its place.

    live camera ------> rate ! ... ! encoder ! ... ! listener
    candidate ---> valve

Encoder, muxer and listener notice nothing but frames of another picture, so viewers stay connected, and the
longest time without a frame is about two frame intervals. A candidate that can't be opened, or delivers
nothing, costs the live camera nothing.

1. The candidate is started in the pipeline, with nothing behind it. A valve at its end drops its frames.
2. With the first of them, the live camera's pad is unlinked while nothing passes it, and the candidate's pad
   linked; from here on what the old camera delivers is dropped.
3. The valve opens for the first frame that is later than the newest one of the old camera: time never runs
   backwards for the encoder. A camera whose stamps lag is waited for as long as they do; its frames are not
   moved in time, because a driver has to see how old a picture is.
4. The old camera is stopped and removed, with a deadline.

Python runs per frame only during these steps.
"""

import asyncio
import threading
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from common.gst import Gst, stop_element
from preview.pipeline import builder, capture_clock
from preview.pipeline.builder import Parts
from preview.pipeline.plan import Plan
from preview.pipeline.threads import call_on_loop, in_thread

RELINK_DEADLINE_S: Final = 2.0
_BUFFERS: Final = Gst.PadProbeType.BUFFER | Gst.PadProbeType.BUFFER_LIST


class CameraFailedError(Exception):
    """A camera does not deliver.

    Args:
        what: what it did, as the predicate of a sentence.
    """


class Candidate:
    """A camera on its way into a pipeline; created and used on the loop.

    Args:
        parts: the pipeline.
        plan: with the candidate as its source.

    Attributes:
        source: its bin.

    Raises:
        UserError: it can't be built.
    """

    def __init__(self, parts: Parts, plan: Plan) -> None:
        self._parts = parts
        self._loop = asyncio.get_running_loop()
        self._delivers: asyncio.Future[None] = self._loop.create_future()
        # A failure that comes too late for `deliver` has been handled otherwise.
        self._delivers.add_done_callback(lambda done: done.cancelled() or done.exception())
        self.source = builder.build_source(plan)
        # The pipeline does not start it, and its failure to start is none of the pipeline's.
        self.source.set_locked_state(True)
        self._pad = self.source.get_static_pad("src")
        self._gate = _Gate(parts.body_pad)
        self._state = threading.Lock()
        """Held while it is started, and while it is stopped."""
        self._stopped = False
        self._valve = self._pad.add_probe(_BUFFERS | Gst.PadProbeType.EVENT_DOWNSTREAM, self._drop)
        parts.pipeline.add(self.source)

    @property
    def held_back(self) -> int:
        """Frames that it delivered once it was linked, and whose time had passed by then."""
        return self._gate.held_back

    def fail(self, what: str) -> None:
        """Has `deliver` raise CameraFailedError, if it waits."""
        if not self._delivers.done():
            self._delivers.set_exception(CameraFailedError(what))

    async def deliver(self, deadline_s: float, read_bus: Callable[[], None]) -> None:
        """Starts it and waits for its first frame.

        Args:
            deadline_s: from the start to the first frame.
            read_bus: takes the errors that were posted by now, which call `fail`.

        Raises:
            CameraFailedError: it fails, ends, or sends none in time.
        """
        pipeline, source = self._parts.pipeline, self.source
        source_time = source.get_by_name(builder.SOURCE_TIME)

        def start() -> bool:
            with self._state:
                if self._stopped:
                    return True
                outcome = capture_clock.play_beside(pipeline, source, source_time)
                return bool(outcome != Gst.StateChangeReturn.FAILURE)

        try:
            async with asyncio.timeout(deadline_s):
                if not await in_thread(start, deadline_s):
                    read_bus()
                    # Counts only if no element posted an error.
                    self.fail("could not be started and gave no reason")
                await asyncio.shield(self._delivers)
        except TimeoutError:
            raise CameraFailedError(f"has sent no frame for {deadline_s:.1f} s") from None

    async def take_over(self, old: Any, plan: Plan) -> None:
        """Links the candidate in the place of the old camera, which goes on without effect.

        Args:
            old: bin of the old camera.
            plan: in effect by now, with the candidate as its source.

        Raises:
            CameraFailedError: they can't be linked; the old camera goes on.
            TimeoutError: the call hangs.
        """
        old_pad, pad, body_pad = old.get_static_pad("src"), self._pad, self._parts.body_pad
        done, lock, outcomes = threading.Event(), threading.Lock(), list[Any]()

        def relink(_pad: Any, _info: Any) -> Any:
            with lock:
                if not outcomes:
                    outcomes.append(_relink(old_pad, pad, body_pad))
                    done.set()
            return Gst.PadProbeReturn.REMOVE

        def work() -> bool:
            builder.apply_source_target(self.source, plan)
            # Called here and now if nothing passes, else by the old camera's thread when it has passed.
            old_pad.add_probe(Gst.PadProbeType.IDLE, relink)
            done.wait(RELINK_DEADLINE_S)
            with lock:
                if not outcomes:
                    outcomes.append(None)  # From here on, it is too late.
            return bool(outcomes[0] == Gst.PadLinkReturn.OK)

        if not await in_thread(work, 2 * RELINK_DEADLINE_S):
            raise CameraFailedError("does not deliver raw video")
        self._pad.remove_probe(self._valve)
        self._gate.open()

    async def stop(self, deadline_s: float) -> None:
        """Stops it and removes it from the pipeline: it has not been taken over.

        Raises:
            TimeoutError: it hangs; it stays in the pipeline.
        """
        self._gate.remove()

        def work() -> None:
            # A start whose waiter was cancelled would set it to play after this.
            with self._state:
                self._stopped = True
                _remove(self._parts.pipeline, self.source)

        await in_thread(work, deadline_s)
        # Not before: it keeps frames from a pad that leads nowhere. With it, pad and candidate, and so the
        # whole pipeline, would keep each other alive.
        self._pad.remove_probe(self._valve)

    def _drop(self, _pad: Any, info: Any) -> Any:
        """Drops what comes before it is linked, on the candidate's thread."""
        if info.type & Gst.PadProbeType.EVENT_DOWNSTREAM:
            if info.get_event().type != Gst.EventType.EOS:
                return Gst.PadProbeReturn.OK
            call_on_loop(self._loop, self.fail, "has ended")
        else:
            call_on_loop(self._loop, self._first_frame)
        return Gst.PadProbeReturn.DROP

    def _first_frame(self) -> None:
        if not self._delivers.done():
            self._delivers.set_result(None)


class _Gate:
    """Keeps the times of the frames that enter the pipeline's body growing, while cameras change.

    Args:
        pad: where they enter.
    """

    def __init__(self, pad: Any) -> None:
        self._pad = pad
        self._newest = 0
        self._held_back = 0
        self._opening = False
        self._removed = False
        self._lock = threading.Lock()
        self._probe_id = pad.add_probe(_BUFFERS, self._probe)

    @property
    def held_back(self) -> int:
        """Frames so far whose time had passed when they came."""
        with self._lock:
            return self._held_back

    def open(self) -> None:
        """Removes it after the next frame that is later than all before."""
        with self._lock:
            self._opening = True

    def remove(self) -> None:
        """Removes it."""
        with self._lock:
            if not self._removed:
                self._removed = True
                self._pad.remove_probe(self._probe_id)

    def _probe(self, _pad: Any, info: Any) -> Any:
        """Notes the time of a frame, on the camera's thread."""
        buffer = info.get_buffer()
        if buffer is None or buffer.pts == Gst.CLOCK_TIME_NONE:
            return Gst.PadProbeReturn.OK
        with self._lock:
            if buffer.pts <= self._newest:
                self._held_back += 1
                return Gst.PadProbeReturn.DROP
            self._newest = buffer.pts
            if self._opening and not self._removed:
                self._removed = True
                return Gst.PadProbeReturn.REMOVE
        return Gst.PadProbeReturn.OK


async def dispose(pipeline: Any, source: Any, deadline_s: float) -> None:
    """Stops a camera and removes it from its pipeline.

    Raises:
        TimeoutError: it hangs; it stays in the pipeline.
    """
    await in_thread(partial(_remove, pipeline, source), deadline_s)


def _remove(pipeline: Any, source: Any) -> None:
    stop_element(source)
    pipeline.remove(source)


def _relink(old_pad: Any, pad: Any, body_pad: Any) -> Any:
    """Replaces the peer of the body's pad, while nothing passes; returns the Gst.PadLinkReturn."""
    old_pad.unlink(body_pad)
    outcome = pad.link(body_pad)
    if outcome == Gst.PadLinkReturn.OK:
        old_pad.add_probe(_BUFFERS | Gst.PadProbeType.EVENT_DOWNSTREAM, _discard)
    else:
        old_pad.link(body_pad)
    return outcome


def _discard(_pad: Any, _info: Any) -> Any:
    return Gst.PadProbeReturn.DROP
