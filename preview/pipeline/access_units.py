"""Access units of the encoder for a recording: each one, with its capture time, before the transport stream.

The probe exists only while they are wanted: it runs Python for each frame. It hands over a copy; what the
event loop has not taken yet is bounded, and what exceeds that is counted as skipped.
"""

import asyncio
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from common.gst import Gst
from preview.pipeline.capture_clock import captured_ns
from preview.pipeline.events import AccessUnit
from preview.pipeline.threads import call_on_loop

_MAX_WAITING_BYTES: Final = 4 << 20


@dataclass(slots=True)
class _Waiting:
    """What has been handed over and not been taken, under the lock."""

    bytes: int = 0
    skipped: int = 0


class AccessUnits:
    """The probe behind the parser of one pipeline; created and used on the loop.

    Args:
        pad: where all access units pass.
        take: called on the loop with each one.
    """

    def __init__(self, pad: Any, take: Callable[[AccessUnit], None]) -> None:
        self._loop = asyncio.get_running_loop()
        self._pad = pad
        self._take = take
        self._closed = False
        self._lock = threading.Lock()
        self._waiting = _Waiting()
        self._probe_id = pad.add_probe(Gst.PadProbeType.BUFFER, self._probe)

    def close(self) -> None:
        """Removes the probe; nothing is handed over from here on."""
        self._closed = True
        self._pad.remove_probe(self._probe_id)
        del self._pad

    def _probe(self, pad: Any, info: Any) -> Any:
        """Copies an access unit, on the encoder's thread."""
        buffer = info.get_buffer()
        size = buffer.get_size()
        with self._lock:
            waiting = self._waiting
            if waiting.bytes + size > _MAX_WAITING_BYTES:
                waiting.skipped += 1
                return Gst.PadProbeReturn.OK
            waiting.bytes += size
            skipped, waiting.skipped = waiting.skipped, 0
        unit = AccessUnit(
            data=buffer.extract_dup(0, size),
            captured_ns=captured_ns(buffer, pad),
            key_frame=not buffer.has_flags(Gst.BufferFlags.DELTA_UNIT),
            skipped=skipped,
        )
        call_on_loop(self._loop, self._hand_over, unit)
        return Gst.PadProbeReturn.OK

    def _hand_over(self, unit: AccessUnit) -> None:
        with self._lock:
            self._waiting.bytes -= len(unit.data)
        if not self._closed:
            self._take(unit)
