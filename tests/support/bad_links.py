"""Links that fail in ways a closed port does not: silence."""

import select
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Self


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
    """A TCP relay to a local port that can fall silent without closing anything, as bad Wi-Fi does."""

    def __init__(self, port: int) -> None:
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
            ready, _, _ = select.select([self._listener, self._wake_here, *passing], [], [])
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
                    self._pass_on(one)

    def _accept(self) -> None:
        near, _ = self._listener.accept()
        try:
            far = socket.create_connection(self._to)
        except ConnectionRefusedError:
            near.close()
            return
        self._pairs[near], self._pairs[far] = far, near
        self._servers.add(far)
        self.connections += 1

    def _pass_on(self, one: socket.socket) -> None:
        other = self._pairs[one]
        try:
            data = one.recv(65536)
            if data:
                other.sendall(data)
                return
        except OSError:
            pass  # A reset ends the pair as an orderly end does.
        for end in (one, other):
            self._pairs.pop(end, None)
            end.close()
