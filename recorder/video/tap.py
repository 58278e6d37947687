"""Client of the preview's video tap: connects, reads records, connects again.

| failure | follows |
|---|---|
| no preview, no socket | retried after 0.5, 1, 2 ... 10 s |
| the preview ends or is killed | as above; a loss up to the next key frame |
| it says nothing while frames should flow, or stops within a record | disconnected after SILENCE_S, retried |
| something that is no record | disconnected, logged, retried |

While it runs, the preview has a reason to run its pipeline.
"""

import asyncio
import logging
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final, NoReturn

from common.backoff import Backoff
from common.video_tap import HEADER_BYTES, MalformedRecordError, decode_header
from recorder.values import Item
from recorder.video.stream import Now, Stream, channel

_log = logging.getLogger(__name__)

CONNECT_S: Final = 2.0
FIRST_RECORD_S: Final = 5.0
SILENCE_S: Final = 5.0
"""Longest time without a record while frames flow, and from the beginning of a record to its end."""
_FIRST_RETRY_S: Final = 0.5
_LONGEST_RETRY_S: Final = 10.0
_READ_BYTES: Final = 1 << 20
"""Of the stream's buffer; a longer record passes in parts."""


class Tap:
    """The video of one recording.

    Args:
        socket: of the preview's tap.
        put: takes what comes, in order; never waits.
        presets: names of those that record it.

    Attributes:
        connected: whether the tap sends records at present.
        connections: made so far.
        failures: attempts that failed and connections that were lost.
        last_error: of the last failure, for people; empty while connected.
    """

    def __init__(
        self, socket: Path, put: Callable[[Sequence[Item]], None], presets: frozenset[str] = frozenset()
    ) -> None:
        self.connected = False
        self.connections = 0
        self.failures = 0
        self.last_error = ""
        self._socket = socket
        self._put = put
        self._stream = Stream(channel(presets), _now())
        self._backoff = Backoff(_FIRST_RETRY_S, _LONGEST_RETRY_S)

    @property
    def frames(self) -> int:
        """Samples so far."""
        return self._stream.frames

    @property
    def problem(self) -> str:
        """Why no frames come, as far as is known: of the connection, or the preview's own; else empty."""
        return self.last_error or ("" if self._stream.running else self._stream.error)

    def catch_up(self) -> None:
        """Hands over the loss so far, if frames are missing at present."""
        self._put(self._stream.loss_so_far(_now()))

    async def run(self) -> NoReturn:
        """Records until it is cancelled."""
        try:
            while True:
                try:
                    await self._follow()
                except TimeoutError:
                    self._fail("it has stopped sending")
                except (OSError, EOFError) as error:
                    self._fail(_sentence(error))
                except MalformedRecordError as error:
                    self._fail(f"it sent {error}")
                await asyncio.sleep(self._backoff.next_s())
        finally:
            self.connected = False
            self._put(self._stream.end(_now()))

    async def _follow(self) -> NoReturn:
        """Reads one connection until it fails.

        Raises:
            OSError: there is no connection any more.
            EOFError: the preview has closed it.
            TimeoutError: nothing comes.
            MalformedRecordError: something else than records comes.
        """
        async with asyncio.timeout(CONNECT_S):
            reader, writer = await asyncio.open_unix_connection(self._socket, limit=_READ_BYTES)
        self.connections += 1
        try:
            await self._read(reader, FIRST_RECORD_S)
            _log.info("video: connected to %s", self._socket)
            self.connected, self.last_error = True, ""
            self._backoff.reset()
            while True:
                await self._read(reader, SILENCE_S if self._stream.running else None)
        finally:
            writer.close()
            with suppress(OSError):
                await writer.wait_closed()

    async def _read(self, reader: asyncio.StreamReader, patience_s: float | None) -> None:
        """Reads a record; `patience_s` is for its first byte to come, None: for ever."""
        async with asyncio.timeout(patience_s):
            first = await reader.readexactly(1)
        async with asyncio.timeout(SILENCE_S):
            header = decode_header(first + await reader.readexactly(HEADER_BYTES - 1))
            payload = await reader.readexactly(header.length)
        if items := self._stream.take(header, payload, _now()):
            self._put(items)

    def _fail(self, reason: str) -> None:
        if self.connected or reason != self.last_error:
            _log.warning("video: no frames from the preview at %s: %s", self._socket, reason)
        self.connected = False
        self.failures += 1
        self.last_error = reason
        self._stream.disconnected(_now())


def _now() -> Now:
    return Now(time.monotonic_ns(), time.time_ns())


def _sentence(error: OSError | EOFError) -> str:
    if isinstance(error, EOFError):
        return "it closed the connection"
    if isinstance(error, FileNotFoundError | ConnectionRefusedError):
        return "the preview does not serve it (video_tap.socket of its configuration)"
    return error.strerror or type(error).__name__
