"""A camera that stalls without an error: raw frames over TCP, until the test stops them."""

import socket
import threading
from types import TracebackType
from typing import Self

_WIDTH, _HEIGHT = 320, 240
_PERIOD_S = 1 / 30


class StallingCamera:
    """Serves one connection at a time; `description` is the source for it."""

    def __init__(self) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.settimeout(0.1)
        port = self._server.getsockname()[1]
        self.description = (
            f"tcpclientsrc host=127.0.0.1 port={port} do-timestamp=true"
            f" ! rawvideoparse width={_WIDTH} height={_HEIGHT} format=i420 framerate=30/1"
        )
        self._stalled = threading.Event()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="camera")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._thread.join(10)
        self._server.close()

    def stall(self) -> None:
        """Stops the frames; the connection stays."""
        self._stalled.set()

    def go_on(self) -> None:
        """Continues the frames."""
        self._stalled.clear()

    def _serve(self) -> None:
        while not self._over.is_set():
            try:
                connection, _ = self._server.accept()
            except TimeoutError:
                continue
            with connection:
                self._send_frames(connection)

    def _send_frames(self, connection: socket.socket) -> None:
        connection.settimeout(5)
        shade = 0
        try:
            while not self._over.wait(_PERIOD_S):
                if self._stalled.is_set():
                    # A client that gave up is noticed, so that the next one can be served.
                    connection.setblocking(False)
                    try:
                        if connection.recv(1) == b"":
                            return
                    except BlockingIOError:
                        continue
                connection.setblocking(True)
                shade = (shade + 5) % 256
                connection.sendall(bytes([shade]) * (_WIDTH * _HEIGHT) + b"\x80" * (_WIDTH * _HEIGHT // 2))
        except OSError:
            return
