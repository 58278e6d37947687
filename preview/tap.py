"""Video tap: hands the encoder's output to the recorder, over a Unix socket.

A reader gets an info about the stream, then access units from a key frame on, and another info before what
follows each change (common/video_tap.py has the records). While there is a reader, a pipeline runs for it,
whether viewers want one or not.

What can fail, and what follows:

| failure | follows |
|---|---|
| a reader is slow | its queue is bounded; units are dropped up to a key frame, and a gap says so |
| a reader stops reading for ever | as above: it costs the bound, and no one waits for it |
| a reader sends something | it is disconnected: it has nothing to say |
| more readers than MAX_READERS | refused: disconnected at once |
| the pipeline fails or is replaced | the next one's units follow a gap |
"""

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NoReturn, cast

from common import bind
from common.tasks import cancel
from common.video_tap import Header, Kind, encode_object
from preview.pipeline.events import AccessUnit
from preview.state.values import RecordedStream
from preview.supervisor.supervisor import Supervisor

_log = logging.getLogger(__name__)

MAX_READERS: Final = 4
MAX_WAITING_BYTES: Final = 4 << 20
"""Of one reader, in this process; the kernel's socket buffer is beside it."""
_INFO_ROOM_BYTES: Final = 64 << 10
"""On top, for infos to a reader that does not read; then it is disconnected."""


class VideoTap:
    """The tap of one service.

    Args:
        supervisor: owns the pipelines.
    """

    def __init__(self, supervisor: Supervisor) -> None:
        self._supervisor = supervisor
        self._readers: set[_Reader] = set()
        self._info = b""
        """The newest record about the stream."""
        self._informed_of: RecordedStream | None = None

    @asynccontextmanager
    async def serving(self, path: Path) -> AsyncIterator[None]:
        """Serves while the block lasts.

        Raises:
            UserError: the socket can't be used.
        """
        server = await asyncio.get_running_loop().create_unix_server(
            lambda: _Reader(self), sock=bind.stream_socket(path)
        )
        informing = asyncio.create_task(self._inform_of_changes(), name="video tap: infos")
        _log.info("the video tap is at %s", path)
        try:
            yield
        finally:
            await cancel([informing])
            server.close()
            self._end(path)

    # --- for the readers ---

    def add(self, reader: "_Reader") -> bool:
        """Adds a reader, which gets an info and then a key frame; False when there are enough."""
        if len(self._readers) >= MAX_READERS:
            _log.warning("video tap: refused a reader, %d are connected", len(self._readers))
            return False
        self._inform()
        reader.inform(self._info)
        self._readers.add(reader)
        _log.info("video tap: %d readers", len(self._readers))
        if len(self._readers) == 1:
            self._supervisor.record(self)
        self._supervisor.request_recorded_key_frame()
        return True

    def remove(self, reader: "_Reader") -> None:
        """Removes a reader that has disconnected."""
        if reader not in self._readers:
            return
        self._readers.remove(reader)
        _log.info("video tap: %d readers", len(self._readers))
        if not self._readers:
            self._supervisor.record(None)

    # --- for the supervisor ---

    def take(self, unit: AccessUnit) -> None:
        """Sends an access unit to all readers."""
        self._inform()
        for reader in tuple(self._readers):
            reader.send(unit)

    def interrupted(self) -> None:
        """Makes all readers wait for a key frame of the next pipeline."""
        for reader in self._readers:
            reader.interrupt()

    def _end(self, path: Path) -> None:
        for reader in tuple(self._readers):
            reader.disconnect()
        path.unlink(missing_ok=True)

    async def _inform_of_changes(self) -> NoReturn:
        """Sends infos also while there are no access units."""
        while True:
            await self._supervisor.changes.wait_until(self._is_outdated)
            self._inform()

    def _is_outdated(self) -> bool:
        return bool(self._readers) and self._supervisor.recorded_stream() != self._informed_of

    def _inform(self) -> None:
        """Sends what is known of the stream to all readers, if it has changed."""
        stream = self._supervisor.recorded_stream()
        if stream == self._informed_of:
            return
        self._informed_of, self._info = stream, encode_object(Kind.INFO, _info(stream))
        for reader in tuple(self._readers):
            reader.inform(self._info)


@dataclass(slots=True)
class _Gap:
    """What a reader did not get.

    Args:
        from_ns: capture time of the last access unit before it.
        frames: None: not known.
    """

    from_ns: int
    frames: int | None


class _Reader(asyncio.Protocol):
    """One connection. Never waits: asyncio's transport is the queue, and its size is looked at first."""

    def __init__(self, tap: VideoTap) -> None:
        self._tap = tap
        self._transport: asyncio.Transport | None = None
        self._awaits_key_frame = True
        self._last_ns: int | None = None
        """Capture time of the newest access unit sent."""
        self._gap: _Gap | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Takes its place among the readers."""
        self._transport = cast("asyncio.Transport", transport)
        if not self._tap.add(self):
            self.disconnect()

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002  # asyncio's
        """Gives its place up."""
        self._transport = None
        self._tap.remove(self)

    def data_received(self, data: bytes) -> None:
        """Disconnects: a reader has nothing to say."""
        _log.warning("video tap: disconnected a reader that sent %d bytes", len(data))
        self.disconnect()

    def disconnect(self) -> None:
        """Ends the connection; what waits is not sent any more."""
        if self._transport:
            self._transport.abort()

    def inform(self, record: bytes) -> None:
        """Sends an info."""
        if not self._transport:
            return
        if self._transport.get_write_buffer_size() > MAX_WAITING_BYTES + _INFO_ROOM_BYTES:
            _log.warning("video tap: disconnected a reader that does not read")
            self.disconnect()
            return
        self._transport.write(record)

    def interrupt(self) -> None:
        """Notes a gap of unknown size, up to the next key frame."""
        if self._last_ns is not None:
            self._gap = _Gap(self._last_ns, None)
        self._awaits_key_frame = True

    def send(self, unit: AccessUnit) -> None:
        """Sends an access unit, or drops it."""
        if not self._transport:
            return
        room = MAX_WAITING_BYTES - self._transport.get_write_buffer_size()
        if unit.skipped:
            self._miss(unit.skipped)
        if len(unit.data) > room or (self._awaits_key_frame and not unit.key_frame):
            self._miss(1)
            return
        if self._gap:
            gap, self._gap = self._gap, None
            content = {"frames": gap.frames, "from_ns": gap.from_ns, "to_ns": unit.captured_ns}
            self._transport.write(encode_object(Kind.GAP, content))
        header = Header(Kind.ACCESS_UNIT, len(unit.data), unit.key_frame, unit.captured_ns)
        self._transport.writelines((header.encode(), unit.data))
        self._awaits_key_frame, self._last_ns = False, unit.captured_ns

    def _miss(self, frames: int) -> None:
        """Counts frames that this reader does not get; before its first one there is no gap."""
        self._awaits_key_frame = True
        if self._last_ns is None:
            return
        if self._gap is None:
            self._gap = _Gap(self._last_ns, 0)
        if self._gap.frames is not None:
            self._gap.frames += frames


def _info(stream: RecordedStream) -> dict[str, Any]:
    """Returns the content of an info; every number is in the unit of its name."""
    info: dict[str, Any] = {
        "state": stream.state.value,
        "profile": stream.profile.value,
        "error": stream.error,
    }
    if stream.camera:
        info["camera"] = stream.camera
    if stream.encoder:
        info |= {"encoder": stream.encoder.name, "fallback_reason": stream.encoder.fallback_reason}
    if stream.stream:
        target = stream.stream.target
        info |= {
            "codec": stream.stream.codec.value,
            "width_px": target.width_px,
            "height_px": target.height_px,
            "fps": target.fps,
            "bitrate_kbps": stream.stream.bitrate_kbps,
            "bitrate_reason": stream.stream.bitrate_reason,
        }
    return info
