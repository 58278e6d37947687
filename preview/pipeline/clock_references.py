"""Clock references (PCR) between frames, for streams with few frames per second.

The PCR shall come at least every 100 ms (ISO/IEC 13818-1 2.7.2); receivers and DVB's measurement guidelines
(ETSI TR 101 290, PCR_error) expect 40 ms. The muxer writes one with a frame only: every 67 ms at 15 frames
per second. So packets that carry nothing but a PCR are sent in between.

A thread of its own sends them, because sending must not block the event loop. It sends under the lock under
which the streaming thread announces the next frame, and only once the newest one has been written: so a
reference is sent before the next frame or not at all, and never ahead of a frame's own PCR. A frame that is
late is preceded by no more references than one in time, and after a change of the frame rate none is sent
before two frames came at the new interval. At high frame rates there is no thread.
"""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

PACKET_BYTES: Final = 188
MAX_GAP_S: Final = 0.038
"""Between two references: just below 40 ms."""
_INTERVAL_S: Final = 0.030
"""Longest time from a frame to the first reference after it, and on to the next."""
_LOOK_AGAIN_S: Final = 0.001
"""Where a frame takes longer to be passed on than until its first reference: a machine that is very busy."""
_CLOCK_HZ: Final = 27_000_000
_WRAP: Final = (1 << 33) * 300
"""Ticks: program_clock_reference_base has 33 bits, and counts every 300th tick (2.4.3.5)."""
HEAD_PACKETS: Final = 6
"""A frame's own PCR is in its first packet, which follows the tables."""


@dataclass(frozen=True, slots=True)
class Reference:
    """PCR of a frame.

    Args:
        ticks: system clock of 27 MHz at the frame.
        pid: PID of the packets that carry the PCR.
        counter: continuity_counter of the last of them.
    """

    ticks: int
    pid: int
    counter: int

    def packet(self, seconds: float) -> bytes:
        """Encodes a packet with the clock `seconds` later.

        It has an adaptation field and no payload, so continuity_counter does not advance (ISO/IEC 13818-1
        2.4.3.3 to 2.4.3.5).
        """
        base, extension = divmod((self.ticks + round(seconds * _CLOCK_HZ)) % _WRAP, 300)
        clock = base << 15 | 0x3F << 9 | extension
        header = bytes((0x47, self.pid >> 8, self.pid & 0xFF, 0x20 | self.counter))
        field = bytes((PACKET_BYTES - 5, 0x10)) + clock.to_bytes(6)
        return (header + field).ljust(PACKET_BYTES, b"\xff")


def read(packets: bytes) -> Reference | None:
    """Returns the PCR of a frame; None when it has none.

    Args:
        packets: the first HEAD_PACKETS of the frame or more, and its last one, which is of the video.
    """
    for start in range(0, min(len(packets), HEAD_PACKETS * PACKET_BYTES), PACKET_BYTES):
        has_clock = packets[start + 3] & 0x20 and packets[start + 4] >= 7 and packets[start + 5] & 0x10
        if has_clock:
            field = int.from_bytes(packets[start + 6 : start + 12])
            return Reference(
                ticks=(field >> 15) * 300 + (field & 0x1FF),
                pid=(packets[start + 1] & 0x1F) << 8 | packets[start + 2],
                counter=packets[-PACKET_BYTES + 3] & 0x0F,
            )
    return None


def rhythm(fps: float) -> tuple[int, float]:
    """Returns how many references follow a frame, and the seconds from it to the first and on to the next.

    Spread evenly, so that each reference may be a little late.
    """
    period_s = 1 / fps
    count = max(0, math.ceil((period_s - MAX_GAP_S) / _INTERVAL_S))
    return count, min(_INTERVAL_S, period_s / (count + 1))


class ClockReferences:
    """Sends references between frames.

    Args:
        send: passes a packet to the listener; called on a thread of its own.
        written: returns how many frames have been passed on so far.
        fps: frame rate.
    """

    def __init__(self, send: Callable[[bytes], None], written: Callable[[], int], fps: float) -> None:
        self._send = send
        self._written = written
        self._changed = threading.Condition()
        self._frame: Reference | None = None
        """The newest frame; None where no references follow it."""
        self._frame_at = 0.0
        self._written_before = 0
        """Frames passed on before the newest."""
        self._sent = 0
        self._in_rhythm = True
        """Whether frames come at the interval that the frame rate says."""
        self._count, self._interval_s = rhythm(fps)
        self._thread: threading.Thread | None = None

    @property
    def wanted(self) -> bool:
        """Whether references follow the frames at this rate."""
        return self._count > 0

    def set_rate(self, fps: float) -> None:
        """Sets another frame rate."""
        with self._changed:
            self._count, self._interval_s = rhythm(fps)
            self._frame, self._in_rhythm = None, False
            self._changed.notify()

    def follow(self, packets: bytes) -> None:
        """Schedules the references that follow a frame, on the streaming thread, before it is passed on.

        Args:
            packets: the frame, at least as much as `read` needs.
        """
        with self._changed:
            if not self._count:
                return
            before, self._frame = self._frame, read(packets)
            self._frame_at, self._sent = time.monotonic(), 0
            self._written_before = self._written()
            if before and self._frame and not self._in_rhythm:
                # Frames closer together leave no room for the last reference.
                apart_ticks = (self._frame.ticks - before.ticks) % _WRAP
                self._in_rhythm = apart_ticks > round(self._count * self._interval_s * _CLOCK_HZ)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="clock-references", daemon=True)
                self._thread.start()
            self._changed.notify()

    def stop(self) -> None:
        """Stops sending and releases the listener, which has stopped. The thread ends by itself."""
        with self._changed:
            self._count = 0
            del self._send, self._written
            self._changed.notify()

    def _run(self) -> None:
        with self._changed:
            while self._count:
                self._changed.wait(self._send_due())
            self._thread = None

    def _send_due(self) -> float | None:
        """Sends the references that are due; returns the seconds to the next one, None: wait for a frame."""
        if self._frame is None or not self._in_rhythm:
            return None
        while self._sent < self._count:
            due_s = self._interval_s * (self._sent + 1)
            left_s = self._frame_at + due_s - time.monotonic()
            if left_s > 0:
                return left_s
            if self._written() == self._written_before:
                return _LOOK_AGAIN_S
            self._sent += 1
            self._send(self._frame.packet(due_s))
        return None
