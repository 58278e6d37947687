"""Encoders that are being stopped, of which some may take longer than the next pipeline waits for them."""

import asyncio

from preview.encoders.crash_marker import CrashMarkerFile
from preview.encoders.selection import Selection
from preview.pipeline.events import HungError


class Teardowns:
    """Keeps the crash marker set while an encoder is being stopped: that may end the process, too.

    Args:
        marker: names the encoder in use.
        encoders: know which ones are proven.
    """

    def __init__(self, marker: CrashMarkerFile, encoders: Selection) -> None:
        self._marker = marker
        self._encoders = encoders
        self._stopping: dict[asyncio.Task[bool], str] = {}
        """Names of the encoders, by their teardown."""

    def __bool__(self) -> bool:
        """Whether an encoder has not stopped yet."""
        return bool(self._stopping)

    async def wait_for(self, teardown: "asyncio.Task[bool]", encoder: str, wait_s: float | None) -> None:
        """Waits for a teardown; leaves it behind after `wait_s`, None: after its own deadline."""
        self._stopping[teardown] = encoder
        await asyncio.wait({teardown}, timeout=wait_s)
        self._stopping = {task: name for task, name in self._stopping.items() if not _has_finished(task)}
        if not self._stopping:
            self._marker.clear()

    async def join(self) -> None:
        """Waits for encoders that were left behind.

        Raises:
            HungError: one of them hangs; the crash marker names it.
        """
        if self._stopping:
            await asyncio.wait(self._stopping)
        hung = [name for task, name in self._stopping.items() if not _has_finished(task)]
        self._stopping.clear()
        if hung:
            self._marker.set(hung[0], "it hung when it was stopped", self._encoders.proven)
            raise HungError(f"encoder {hung[0]} hung when it was stopped")
        self._marker.clear()


def _has_finished(teardown: "asyncio.Task[bool]") -> bool:
    """Whether an encoder is stopped; not while it is stopping, nor when it hangs."""
    return teardown.done() and teardown.result()
