"""A viewer that looks on in the background and notes when pictures came."""

import threading
from itertools import pairwise
from types import TracebackType
from typing import Self

from console.receiver.address import StreamAddress
from console.receiver.errors import NoPictureError
from console.receiver.receiver import Receiver, Reconnect
from tests.support.waiting import wait_until


class Watcher:
    """Watches a stream on this machine until it is left; calls again when the connection is lost.

    Args:
        port: the listener's.
        passphrase: of the stream.
        latency_ms: SRT latency.
    """

    def __init__(self, port: int, passphrase: str = "", latency_ms: int = 20) -> None:
        self.arrivals_s: list[float] = []
        self.codecs: list[str] = []
        self._receiver = Receiver(
            StreamAddress("127.0.0.1", port, latency_ms=latency_ms, passphrase=passphrase),
            reconnect=Reconnect(),
            queue_size=8,
        )
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="watcher")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._thread.join(10)
        self._receiver.close()

    @property
    def reconnects(self) -> int:
        """How often it had to call again."""
        return self._receiver.reconnects

    @property
    def longest_pause_s(self) -> float:
        """The longest time between two pictures so far."""
        arrivals = list(self.arrivals_s)
        return max((after - before for before, after in pairwise(arrivals)), default=0.0)

    def wait_for_pictures(self, count: int) -> None:
        """Waits for `count` more pictures."""
        wanted = len(self.arrivals_s) + count
        wait_until(lambda: len(self.arrivals_s) >= wanted, f"{count} more pictures", 20)

    def _watch(self) -> None:
        while not self._over.is_set():
            try:
                frame = self._receiver.next_frame(timeout_s=0.2)
            except NoPictureError:
                continue
            self.arrivals_s.append(frame.arrival_s)
            self.codecs.append(frame.codec)
