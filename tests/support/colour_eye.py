"""A viewer that knows the colour of what it sees, and connects again when it must."""

import threading
from itertools import pairwise
from typing import NamedTuple, Self

from console.receiver.address import StreamAddress
from console.receiver.errors import StreamError
from console.receiver.frame import Frame
from console.receiver.options import ReceiverOptions
from tests.support.receiver import NoFrameError, Receiver
from tests.support.waiting import wait_until

# Chroma of a plain colour, Cb and Cr (ITU-R BT.601).
CHROMA = {"red": (90, 240), "green": (54, 34), "blue": (240, 110)}
_RETRY_S = 0.1
# A machine that stalls makes frames late, and no reason to connect anew.
_PATIENT = ReceiverOptions(max_age_s=10.0)


def colour(frame: Frame) -> str:
    """The plain colour of a frame; "mixed" for anything else."""
    pixels = frame.read()
    luma, size = frame.stride * frame.height, frame.stride // 2 * (frame.height // 2)
    middle = frame.stride // 2 * (frame.height // 4) + frame.width // 4
    cb, cr = pixels[luma + middle], pixels[luma + size + middle]
    near = [name for name, (b, r) in CHROMA.items() if abs(b - cb) < 25 and abs(r - cr) < 25]
    return near[0] if near else "mixed"


class Seen(NamedTuple):
    """A frame that came.

    Attributes:
        at_s: when, on `time.monotonic()`.
        colour: of `colour`.
        pts_s: of the stream.
    """

    at_s: float
    colour: str
    pts_s: float


class Eye:
    """Watches a stream on this machine until its block ends.

    Attributes:
        seen: each frame that came.
        lost: why it had to connect again, each time.
    """

    def __init__(self, port: int) -> None:
        self.seen: list[Seen] = []
        self.lost: list[str] = []
        self._address = StreamAddress("127.0.0.1", port, latency_ms=20)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="eye")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self._over.set()
        self._thread.join(10)

    def sees(self, name: str, within_s: float = 20) -> float:
        """Waits for frames of a colour from now on; returns when the first one came."""
        begin = len(self.seen)
        wait_until(lambda: name in self.colours(begin), f"{name} is seen", within_s)
        return next(each.at_s for each in self.seen[begin:] if each.colour == name)

    def colours(self, since: int = 0) -> set[str]:
        """The colours of the frames from the given one on."""
        return {each.colour for each in self.seen[since:]}

    def longest_gap_s(self, since: int = 0) -> float:
        """The longest time between two frames, from the given one on."""
        return max(later.at_s - sooner.at_s for sooner, later in pairwise(self.seen[since:]))

    def more_frames(self, count: int) -> None:
        """Waits for so many more."""
        expected = len(self.seen) + count
        wait_until(lambda: len(self.seen) >= expected, f"{count} more frames", 20)

    def _watch(self) -> None:
        while not self._over.is_set():
            try:
                with Receiver(self._address, queue_size=30, options=_PATIENT) as receiver:
                    self._take(receiver)
            except StreamError as error:
                self.lost.append(str(error))
                self._over.wait(_RETRY_S)

    def _take(self, receiver: Receiver) -> None:
        while not self._over.is_set():
            try:
                frame = receiver.next_frame(timeout_s=0.2)
            except NoFrameError:
                continue
            self.seen.append(Seen(frame.arrival_s, colour(frame), (frame.pts_ns or 0) / 1e9))
