"""Readers of a video tap: the recorder's own client in a thread, and a bare socket."""

import asyncio
import socket
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from common.video_tap import HEADER_BYTES, Header, decode_header
from recorder.values import Item, Loss, Note, Sample
from recorder.video.tap import Tap
from tests.support.waiting import wait_until

PATIENCE_S = 20.0


class TapRecording:
    """What the recorder's client gets while the block lasts.

    Args:
        path: of the tap's socket.
    """

    def __init__(self, path: Path) -> None:
        self.items: list[Item] = []
        self.tap = Tap(path, self._put)
        self._loop = asyncio.new_event_loop()
        self._task: asyncio.Task[None] | None = None
        self._thread = threading.Thread(target=self._run, name="tap")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        wait_until(lambda: self._task is not None, "the client runs", PATIENCE_S)
        assert self._task
        self._loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join(PATIENCE_S)
        assert not self._thread.is_alive()

    @property
    def samples(self) -> list[Sample]:
        return [item for item in self.items if isinstance(item, Sample)]

    @property
    def losses(self) -> list[Loss]:
        return [item for item in self.items if isinstance(item, Loss)]

    def notes(self, name: str) -> list[Note]:
        return [item for item in self.items if isinstance(item, Note) and item.name == name]

    def wait_for_frames(self, count: int) -> None:
        """Waits for that many more frames."""
        until = len(self.samples) + count
        wait_until(lambda: len(self.samples) >= until, f"{count} frames", PATIENCE_S)

    def wait_for(self, holds: Callable[[], object], what: str) -> None:
        wait_until(holds, what, PATIENCE_S)

    def _put(self, items: Sequence[Item]) -> None:
        self.items.extend(items)

    def _run(self) -> None:
        async def main() -> None:
            self._task = asyncio.create_task(self.tap.run())
            await asyncio.gather(self._task, return_exceptions=True)

        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(main())


class BareReader:
    """A reader that reads only on request.

    Args:
        path: of the tap's socket.
    """

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.settimeout(PATIENCE_S)
        self._socket.connect(str(path))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._socket.close()

    def send(self, data: bytes) -> None:
        self._socket.sendall(data)

    def record(self) -> tuple[Header, bytes]:
        """The next record.

        Raises:
            EOFError: the tap has closed the connection.
        """
        header = decode_header(self._exactly(HEADER_BYTES))
        return header, self._exactly(header.length)

    def _exactly(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            more = self._socket.recv(count - len(data))
            if not more:
                raise EOFError
            data += more
        return data
