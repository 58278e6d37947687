"""A viewer that watches a stream in the background and records when frames came."""

import threading
from itertools import pairwise
from typing import Self

from common.backoff import Backoff
from console.receiver.address import StreamAddress
from console.receiver.errors import StreamError
from console.receiver.options import MAX_AGE_S, ReceiverOptions
from tests.support.receiver import NoFrameError, Receiver
from tests.support.waiting import wait_until


class Watcher:
    """Watches a stream on this machine until its block ends; connects again when the connection is lost.

    Args:
        port: the listener's.
        passphrase: of the stream.
        latency_ms: SRT latency.
        max_age_s: age of the frames beyond which it connects anew.
    """

    def __init__(
        self, port: int, passphrase: str = "", latency_ms: int = 20, max_age_s: float = MAX_AGE_S
    ) -> None:
        self.arrivals_s: list[float] = []
        self.codecs: list[str] = []
        self.lost: list[str] = []
        """Why it had to connect again, each time."""
        self._options = ReceiverOptions(max_age_s=max_age_s)
        self._address = StreamAddress("127.0.0.1", port, latency_ms=latency_ms, passphrase=passphrase)
        self._backoff = Backoff(first_s=0.1, longest_s=2.0)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="watcher")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self._closing.set()
        self._thread.join(10)

    @property
    def longest_pause_s(self) -> float:
        """The longest time between two frames so far."""
        arrivals = list(self.arrivals_s)
        return max((after - before for before, after in pairwise(arrivals)), default=0.0)

    def wait_for_frames(self, count: int) -> None:
        """Waits for `count` more frames."""
        expected = len(self.arrivals_s) + count
        wait_until(lambda: len(self.arrivals_s) >= expected, f"{count} more frames", 20)

    def _watch(self) -> None:
        while not self._closing.is_set():
            try:
                with Receiver(self._address, queue_size=8, options=self._options) as receiver:
                    self._take_frames(receiver)
            except StreamError as error:
                if error.final:
                    raise
                if not self._closing.wait(self._backoff.next_s()):
                    self.lost.append(str(error))

    def _take_frames(self, receiver: Receiver) -> None:
        while not self._closing.is_set():
            try:
                frame = receiver.next_frame(timeout_s=0.2)
            except NoFrameError:
                continue
            self._backoff.reset()
            self.arrivals_s.append(frame.arrival_s)
            self.codecs.append(frame.codec)
