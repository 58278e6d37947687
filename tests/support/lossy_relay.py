"""A UDP relay on this machine that loses packets on the way to the caller, as a bad radio does."""

import random
import select
import socket
import threading
from types import TracebackType
from typing import Self


class LossyRelay:
    """Relays one caller to a local UDP port.

    Args:
        to_port: where the packets go.
        loss: share of the packets from there that is lost, 0 to 1; may be changed while it runs.
    """

    def __init__(self, to_port: int, loss: float = 0.0) -> None:
        self.loss = loss
        self._to = ("127.0.0.1", to_port)
        self._front = self._socket()
        self._back = self._socket()
        self.port: int = self._front.getsockname()[1]
        self._caller: tuple[str, int] | None = None
        self._luck = random.Random(1)  # the same bad luck every time
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._relay, name="lossy relay")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._thread.join(10)
        self._front.close()
        self._back.close()

    def _socket(self) -> socket.socket:
        made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        made.bind(("127.0.0.1", 0))
        return made

    def _relay(self) -> None:
        while not self._over.is_set():
            ready, _, _ = select.select([self._front, self._back], [], [], 0.1)
            if self._front in ready:
                data, self._caller = self._front.recvfrom(2048)
                self._back.sendto(data, self._to)
            if self._back in ready:
                data = self._back.recv(2048)
                # SRT's control packets have their first bit set: a link that loses them, too, is a dead one.
                control = data[:1] >= b"\x80"
                if self._caller and (control or self._luck.random() >= self.loss):
                    self._front.sendto(data, self._caller)
