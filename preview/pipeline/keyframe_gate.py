"""Key frame for every new viewer, and no frame before it.

A viewer that connects between two key frames can't decode until the next one. So a key frame is requested,
unless there was one just now. Until it comes, frames that reference earlier ones (delta units) are dropped
before the muxer: the new viewer would show garbage, and the others lose at most a few frames that the key
frame replaces.
"""

import asyncio
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from common.gst import Gst
from preview.pipeline.builder import Parts
from preview.pipeline.threads import call_on_loop

_MIN_INTERVAL_S: Final = 0.3
"""Rate limit: viewers that connect within this time share one key frame."""
_MAX_DROPPED: Final = 3
"""Frames; an encoder that ignores the request must not stop the stream."""


class KeyframeGate:
    """Requests key frames for the viewers of one pipeline, and drops frames until they come.

    Args:
        parts: the pipeline.
        request_key_frame: requests a key frame of the encoder; called on the event loop.
    """

    def __init__(self, parts: Parts, request_key_frame: Callable[[], None]) -> None:
        self._loop = asyncio.get_running_loop()
        self._request_key_frame = request_key_frame
        self._last_request_at = float("-inf")
        self._timer: asyncio.TimerHandle | None = None
        self._pad = parts.parser_pad
        self._lock = threading.Lock()
        """Held by threads that open or close the gate: adding a probe and keeping its number is one step."""
        self._probe_id: int | None = None
        """None while the gate is open, which is nearly always: a probe in Python costs time per frame."""
        self._may_drop = 0
        self._disconnect = partial(parts.sink.disconnect, parts.sink.connect("caller-added", self._on_caller))

    def detach(self) -> None:
        """Releases the pipeline, whose listener has stopped: no more viewers connect."""
        self._disconnect()
        # It references the listener, which must be freed to free its port.
        del self._disconnect
        with self._lock:
            if self._probe_id is not None:
                self._pad.remove_probe(self._probe_id)
            self._probe_id = None
            del self._pad
        if self._timer:
            self._timer.cancel()

    def _on_caller(self, *_: Any) -> None:
        """Closes the gate, on SRT's thread and under the lock of its socket."""
        if time.monotonic() - self._last_request_at >= _MIN_INTERVAL_S:
            with self._lock:
                self._may_drop = _MAX_DROPPED
                if self._probe_id is None:
                    self._probe_id = self._pad.add_probe(Gst.PadProbeType.BUFFER, self._probe)
        call_on_loop(self._loop, self._viewer_connected)

    def _probe(self, _pad: Any, info: Any) -> Any:
        """Drops delta units until the key frame, on the encoder's thread."""
        with self._lock:
            if self._may_drop and info.get_buffer().has_flags(Gst.BufferFlags.DELTA_UNIT):
                self._may_drop -= 1
                return Gst.PadProbeReturn.DROP
            self._probe_id = None
            return Gst.PadProbeReturn.REMOVE

    def _viewer_connected(self) -> None:
        wait_s = self._last_request_at + _MIN_INTERVAL_S - time.monotonic()
        if wait_s <= 0:
            self._request()
        elif self._timer is None:
            self._timer = self._loop.call_later(wait_s, self._request)

    def _request(self) -> None:
        self._timer = None
        self._last_request_at = time.monotonic()
        self._request_key_frame()
