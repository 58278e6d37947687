"""What happens when a viewer joins: it gets a key frame at once, and nothing before it.

A viewer that joins between two key frames could decode nothing until the next one. So one is asked for,
unless there was one just now. Until it comes, pictures that need an earlier one are held back before the
muxer: the new viewer would see garbage, and the others lose at most the picture or two that the key frame
replaces.
"""

import asyncio
import time
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from common.gst import Gst
from preview.pipeline.builder import Parts
from preview.pipeline.threads import Crossing

_KEY_FRAMES_APART_S: Final = 0.3
"""A crowd that joins at once gets its key frame at the end of this pause, not one each."""
_HELD_AT_MOST: Final = 3
"""Pictures; an encoder that is deaf to the request must not stop the stream."""


class Joining:
    """Minds the door of one pipeline.

    Args:
        parts: the pipeline.
        crossing: the way to the loop.
        request_key_frame: asks the encoder; called on the loop.
    """

    def __init__(self, parts: Parts, crossing: Crossing, request_key_frame: Callable[[], None]) -> None:
        self._crossing = crossing
        self._request = request_key_frame
        self._last_request_at = float("-inf")
        self._timer: asyncio.TimerHandle | None = None
        self._pad = parts.parser_pad
        self._gate_id: int | None = None
        """Of the probe that holds pictures back; None while there is none, which is nearly always: a probe
        in Python costs time with every picture."""
        self._may_hold = 0
        """How many more pictures the gate may hold back."""
        self._disconnect = partial(parts.sink.disconnect, parts.sink.connect("caller-added", self._on_caller))

    def detach(self) -> None:
        """Lets go of the pipeline, whose listener has stopped: nobody joins any more."""
        self._disconnect()
        # It holds the listener, which must be gone for its port to be free.
        del self._disconnect
        gate_id, self._gate_id = self._gate_id, None
        if gate_id is not None:
            self._pad.remove_probe(gate_id)
        del self._pad
        if self._timer:
            self._timer.cancel()

    def _on_caller(self, *_: Any) -> None:
        """On SRT's thread, under its lock: closes the gate and hands over."""
        if time.monotonic() - self._last_request_at >= _KEY_FRAMES_APART_S:
            self._may_hold = _HELD_AT_MOST
            if self._gate_id is None:
                self._gate_id = self._pad.add_probe(Gst.PadProbeType.BUFFER, self._gate)
        self._crossing.hand_over(self._joined)

    def _gate(self, _pad: Any, info: Any) -> Any:
        """On the encoder's thread, for the pictures until the key frame."""
        if self._may_hold == 0 or not info.get_buffer().has_flags(Gst.BufferFlags.DELTA_UNIT):
            self._gate_id = None
            return Gst.PadProbeReturn.REMOVE
        self._may_hold -= 1
        return Gst.PadProbeReturn.DROP

    def _joined(self) -> None:
        wait_s = self._last_request_at + _KEY_FRAMES_APART_S - time.monotonic()
        if wait_s <= 0:
            self._ask()
        elif self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(wait_s, self._ask)

    def _ask(self) -> None:
        self._timer = None
        self._last_request_at = time.monotonic()
        self._request()
