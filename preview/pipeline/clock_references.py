"""Clock references between pictures, for streams with few pictures per second.

A transport stream shall carry its clock (PCR) at least every 40 ms, but the muxer writes one only with a
picture: at 15 pictures per second every 67 ms. So packets that carry nothing else are sent in between.

They are sent by a thread of their own, because sending must not hold up the event loop. Whoever sends, that
thread or the streaming thread, holds one lock, so a reference is sent before the next picture or not at all,
and early enough never to run ahead of that picture's own. A picture that is late gets no more of them than
one in time, and after a change of rate none is sent before two pictures came in the new rhythm: a reference
must not be ahead of the next picture's own. Where pictures come often enough, there is no thread.
"""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

PACKET_BYTES: Final = 188
LONGEST_S: Final = 0.038
"""Between two references; the standard allows 40 ms."""
_APART_S: Final = 0.030
"""From a picture to the first reference after it, and on to the next, at most."""
_CLOCK_HZ: Final = 27_000_000
_WRAP: Final = (1 << 33) * 300
_HEAD_PACKETS: Final = 6
"""Where a picture's own reference is: behind the tables, in its first packet."""


@dataclass(frozen=True, slots=True)
class Reference:
    """What a picture's packets say of the stream's clock.

    Args:
        ticks: of 27 MHz, at the picture.
        pid: of the packets that carry the clock.
        counter: continuity counter of the last of them.
    """

    ticks: int
    pid: int
    counter: int

    def packet(self, seconds: float) -> bytes:
        """A packet with the clock `seconds` later: an adaptation field, no payload, so no counting up."""
        base, extension = divmod((self.ticks + round(seconds * _CLOCK_HZ)) % _WRAP, 300)
        clock = base << 15 | 0x3F << 9 | extension
        header = bytes((0x47, self.pid >> 8, self.pid & 0xFF, 0x20 | self.counter))
        field = bytes((PACKET_BYTES - 5, 0x10)) + clock.to_bytes(6)
        return (header + field).ljust(PACKET_BYTES, b"\xff")


def read(picture: bytes) -> Reference | None:
    """Looks into the packets of a picture, whose last one is of the video; None where there is no clock."""
    for start in range(0, min(len(picture), _HEAD_PACKETS * PACKET_BYTES), PACKET_BYTES):
        has_clock = picture[start + 3] & 0x20 and picture[start + 4] >= 7 and picture[start + 5] & 0x10
        if has_clock:
            field = int.from_bytes(picture[start + 6 : start + 12])
            return Reference(
                ticks=(field >> 15) * 300 + (field & 0x1FF),
                pid=_pid(picture, start),
                counter=picture[-PACKET_BYTES + 3] & 0x0F,
            )
    return None


@dataclass(frozen=True, slots=True)
class Rhythm:
    """What goes between two pictures.

    Args:
        count: of references.
        apart_s: from the picture to the first, and on to the next.
    """

    count: int
    apart_s: float

    @property
    def last_ticks(self) -> int:
        """From the picture to the last reference: pictures closer together leave no room for it."""
        return round(self.count * self.apart_s * _CLOCK_HZ)

    @classmethod
    def at(cls, rate_fps: float) -> "Rhythm":
        """For pictures at this rate; evenly spread where they are few, so that each may be a little late."""
        period_s = 1 / rate_fps
        count = max(0, math.ceil((period_s - LONGEST_S) / _APART_S))
        return cls(count, min(_APART_S, period_s / (count + 1)))


_NONE: Final = Rhythm(0, 0.0)


class ClockReferences:
    """Sends them.

    Args:
        send: hands a packet to the listener; called on a thread of its own.
        rate_fps: of the pictures.
    """

    def __init__(self, send: Callable[[bytes], None], rate_fps: float) -> None:
        self._send = send
        self._news = threading.Condition()
        self._picture: Reference | None = None
        """The newest one; None where there is none to follow."""
        self._picture_at = 0.0
        self._sent = 0
        self._in_rhythm = True
        """Whether pictures come as rarely as they are said to."""
        self._rhythm = Rhythm.at(rate_fps)
        self._thread: threading.Thread | None = None

    def set_rate(self, rate_fps: float) -> None:
        """Another rate of pictures, while they flow. May wait until one is sent."""
        with self._news:
            self._rhythm = Rhythm.at(rate_fps)
            self._picture, self._in_rhythm = None, False
            self._news.notify()

    def around(self, picture: bytes, send_picture: Callable[[], None]) -> None:
        """On the streaming thread: sends a picture; what follows it until the next one is our business."""
        if not self._rhythm.count:
            send_picture()
            return
        with self._news:
            before, self._picture = self._picture, read(picture)
            self._picture_at, self._sent = time.monotonic(), 0
            if before and self._picture and not self._in_rhythm:
                apart_ticks = (self._picture.ticks - before.ticks) % _WRAP
                self._in_rhythm = apart_ticks > self._rhythm.last_ticks
            send_picture()
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="clock-references", daemon=True)
                self._thread.start()
            self._news.notify()

    def stop(self) -> None:
        """Sends nothing more and lets go of the listener, which has stopped. The thread ends by itself."""
        with self._news:
            self._rhythm = _NONE
            del self._send
            self._news.notify()

    def _run(self) -> None:
        with self._news:
            while self._rhythm.count:
                self._news.wait(self._send_due())
            self._thread = None

    def _send_due(self) -> float | None:
        """Sends what is due. Returns in how many seconds the next one is; None: not before there is news."""
        if self._picture is None or not self._in_rhythm:
            return None
        while self._sent < self._rhythm.count:
            due_s = self._rhythm.apart_s * (self._sent + 1)
            left_s = self._picture_at + due_s - time.monotonic()
            if left_s > 0:
                return left_s
            self._sent += 1
            self._send(self._picture.packet(due_s))
        return None


def _pid(packets: bytes, start: int) -> int:
    return (packets[start + 1] & 0x1F) << 8 | packets[start + 2]
