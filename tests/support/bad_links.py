"""Links that fail in ways a closed port does not: silence, and delay."""

import select
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Self

from tests.support.udp_link import Direction, Impairment, Line, next_arrival_in_s


@contextmanager
def black_hole() -> Iterator[int]:
    """A TCP port on 127.0.0.1 that never answers a connection attempt: its queue is full for good."""
    with ExitStack() as stack:
        listener = stack.enter_context(socket.create_server(("127.0.0.1", 0), backlog=0))
        address = listener.getsockname()
        # Attempts are added until one of them hangs; from then on the kernel drops every further one.
        for _ in range(8):
            filler = stack.enter_context(socket.socket())
            filler.settimeout(0.3)
            try:
                filler.connect(address)
            except TimeoutError:
                break
        else:
            raise AssertionError("the port still takes connections")
        yield address[1]


class Relay:
    """A TCP relay to a local port that can fall silent without closing anything, as bad Wi-Fi does.

    Args:
        port: of the server.
        delay_s: how much later bytes arrive, each way; an end of a connection does not wait.
    """

    def __init__(self, port: int, delay_s: float = 0.0) -> None:
        self._on_their_way = Line[tuple[socket.socket, bytes]](Direction(Impairment(delay_s=delay_s), 1))
        self._to = ("127.0.0.1", port)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self._pairs: dict[socket.socket, socket.socket] = {}
        self._servers: set[socket.socket] = set()
        self._silent: set[socket.socket] = set()
        self._wake_here, self._wake_there = socket.socketpair()
        self._fall_silent = threading.Event()
        self._cut = threading.Event()
        self._answers_held = threading.Event()
        self._ended = threading.Event()
        self.connections = 0
        self._thread = threading.Thread(target=self._run, name="relay")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._wake_there.send(b"x")
        self._thread.join(10)
        for one in (*self._pairs, *self._silent, self._listener, self._wake_here, self._wake_there):
            one.close()

    def fall_silent(self) -> None:
        """From now on nothing passes on the connections that exist; new ones work."""
        self._fall_silent.set()
        self._wake_there.send(b"x")

    def hold_answers(self) -> None:
        """From now on what the server sends waits; what clients send passes."""
        self._answers_held.set()
        self._wake_there.send(b"x")

    def pass_answers(self) -> None:
        """Passes on what has waited, and what comes."""
        self._answers_held.clear()
        self._wake_there.send(b"x")

    def cut(self) -> None:
        """Closes the connections that exist; new ones work."""
        self._cut.set()
        self._wake_there.send(b"x")

    def _run(self) -> None:
        while not self._ended.is_set():
            held = self._servers if self._answers_held.is_set() else set()
            passing = [one for one in self._pairs if one not in held]
            wait_s = next_arrival_in_s(self._on_their_way)
            ready, _, _ = select.select([self._listener, self._wake_here, *passing], [], [], wait_s)
            for one in ready:
                if one is self._listener:
                    self._accept()
                elif one is self._wake_here:
                    self._wake_here.recv(16)
                    if self._fall_silent.is_set():
                        self._fall_silent.clear()
                        self._silent |= set(self._pairs)
                        self._pairs.clear()
                    if self._cut.is_set():
                        self._cut.clear()
                        for end in self._pairs:
                            end.close()
                        self._pairs.clear()
                elif one in self._pairs:
                    self._take(one)
            for one, data in self._on_their_way.arrived(time.monotonic()):
                if one in self._pairs:
                    self._pass_on(one, data)

    def _accept(self) -> None:
        near, _ = self._listener.accept()
        try:
            far = socket.create_connection(self._to)
        except ConnectionRefusedError:
            near.close()
            return
        for end in (near, far):
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._pairs[near], self._pairs[far] = far, near
        self._servers.add(far)
        self.connections += 1

    def _take(self, one: socket.socket) -> None:
        try:
            data = one.recv(65536)
        except OSError:
            data = b""  # A reset ends the pair as an orderly end does.
        if data:
            self._on_their_way.send(data, (self._pairs[one], data))
        else:
            self._end(one)

    def _pass_on(self, one: socket.socket, data: bytes) -> None:
        try:
            one.sendall(data)
        except OSError:
            self._end(one)

    def _end(self, one: socket.socket) -> None:
        for end in (one, self._pairs.pop(one)):
            self._pairs.pop(end, None)
            end.close()
