"""Key frame for every new viewer, and no frame before it; key frames for viewers that lost a picture.

A viewer that connects between two key frames can't decode until the next one. So a key frame is requested,
unless there was one just now. Until it comes, frames that reference earlier ones (delta units) are dropped
before the muxer: the new viewer would show garbage, and the others lose at most a few frames that the key
frame replaces.

A viewer that lost a picture for good needs a key frame that was made after it. One that is awaited serves it,
and so does one that is on its way; otherwise it is requested at once. No frame is dropped meanwhile: other
viewers lost nothing. A token bucket of its own limits these key frames: viewers of a bad link get some in a
row, and a flood of requests leaves the stream most of its bit rate.
"""

import asyncio
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from common.gst import Gst
from common.token_bucket import TokenBucket
from preview.pipeline.builder import Parts
from preview.pipeline.capture_clock import is_later, pts_of
from preview.pipeline.threads import call_on_loop

_MIN_INTERVAL_S: Final = 0.3
"""Rate limit: viewers that connect within this time share one key frame."""
_MAX_DROPPED: Final = 6
"""Frames; an encoder that ignores the request must not stop the stream. On a busy robot it gets it late."""
_MAX_AWAITED: Final = 10
"""Frames until a requested key frame counts as ignored."""
_LOSS_BURST: Final = 3
_LOSS_PER_S: Final = 5.0
"""Key frames for lost pictures; the operators' schema (RequestKeyFrame) documents both."""


class KeyframeGate:
    """Requests key frames for the viewers of one pipeline, and drops frames until a new one's comes.

    Args:
        parts: the pipeline.
        request_key_frame: requests a key frame of the encoder; called on the event loop.
        on_viewer: called on the event loop for each viewer that connects, before its key frame is requested.
    """

    def __init__(
        self, parts: Parts, request_key_frame: Callable[[], None], on_viewer: Callable[[], None]
    ) -> None:
        self._loop = asyncio.get_running_loop()
        self._request_key_frame = request_key_frame
        self._on_viewer = on_viewer
        self._last_request_at = float("-inf")
        self._timer: asyncio.TimerHandle | None = None
        self._pad: Any = parts.parser_pad
        """None once detached."""
        self._lock = threading.Lock()
        """Held by threads that open or close the gate: adding a probe and keeping its number is one step."""
        self._probe_id: int | None = None
        """None while the gate is open, which is nearly always: a probe in Python costs time per frame."""
        self._may_drop = self._may_await = 0
        self._key_frame_pts: int | None = None
        """Of the newest key frame that was requested; others may have been made since."""
        self._losses = TokenBucket(_LOSS_BURST, time.monotonic())
        self._loss_timer: asyncio.TimerHandle | None = None
        """Runs while a lost picture waits for its turn."""
        self._disconnect: Callable[[], None] | None = None
        """Ends the watching of a listener."""

    def watch(self, sink: Any) -> None:
        """Serves the viewers that connect to a listener."""
        self._disconnect = partial(sink.disconnect, sink.connect("caller-added", self._on_caller))

    def unwatch(self) -> None:
        """Releases the listener, if there is one: it must be freed to free its port."""
        if self._disconnect:
            self._disconnect()
        self._disconnect = None

    def detach(self) -> None:
        """Releases the pipeline, whose listener has stopped: no more viewers connect."""
        with self._lock:
            if self._probe_id is not None:
                self._pad.remove_probe(self._probe_id)
            self._probe_id = self._pad = None
        for timer in (self._timer, self._loss_timer):
            if timer:
                timer.cancel()

    def request_after_loss(self, newest_pts: int | None) -> bool:
        """Requests a key frame for a viewer that lost a picture, now or as soon as the rate limit permits.

        Args:
            newest_pts: of the newest picture of which the viewer got anything; None if it does not say.

        Returns:
            Whether it causes a key frame; False when one serves it that is awaited, or on its way.
        """
        with self._lock:
            made = self._key_frame_pts
            on_its_way = made is not None and newest_pts is not None and is_later(made, newest_pts)
            if on_its_way or self._probe_id is not None or self._loss_timer:
                return False
        now = time.monotonic()
        if self._losses.take(now, capacity=_LOSS_BURST, refill_per_s=_LOSS_PER_S):
            self._request()
        else:
            wait_s = (1 - self._losses.tokens) / _LOSS_PER_S
            self._losses.tokens -= 1  # Owed, so that the next one waits until it is refilled.
            self._loss_timer = self._loop.call_later(wait_s, self._take_turn)
        return True

    def _take_turn(self) -> None:
        self._loss_timer = None
        self._request()

    def _request(self) -> None:
        with self._lock:
            self._await_key_frame()
        self._request_key_frame()

    def _await_key_frame(self) -> None:
        """Examines the frames until the key frame; the lock is held."""
        self._may_await = _MAX_AWAITED
        if self._probe_id is None and self._pad is not None:
            self._probe_id = self._pad.add_probe(Gst.PadProbeType.BUFFER, self._probe)

    def _on_caller(self, *_: Any) -> None:
        """Closes the gate, on SRT's thread and under the lock of its socket."""
        if time.monotonic() - self._last_request_at >= _MIN_INTERVAL_S:
            with self._lock:
                self._may_drop = _MAX_DROPPED
                self._await_key_frame()
        call_on_loop(self._loop, self._viewer_connected)

    def _probe(self, pad: Any, info: Any) -> Any:
        """Drops delta units until a new viewer's key frame, on the encoder's thread."""
        buffer = info.get_buffer()
        with self._lock:
            if not buffer.has_flags(Gst.BufferFlags.DELTA_UNIT):
                self._key_frame_pts = pts_of(buffer, pad)
                self._may_drop = self._may_await = 0
            if self._may_drop:
                self._may_drop -= 1
                return Gst.PadProbeReturn.DROP
            if self._may_await:
                self._may_await -= 1
                return Gst.PadProbeReturn.OK
            self._probe_id = None
            return Gst.PadProbeReturn.REMOVE

    def _viewer_connected(self) -> None:
        self._on_viewer()
        wait_s = self._last_request_at + _MIN_INTERVAL_S - time.monotonic()
        if wait_s <= 0:
            self._request_for_viewers()
        elif self._timer is None:
            self._timer = self._loop.call_later(wait_s, self._request_for_viewers)

    def _request_for_viewers(self) -> None:
        self._timer = None
        self._last_request_at = time.monotonic()
        self._request()
