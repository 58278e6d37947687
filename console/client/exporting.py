"""Copies recordings to this computer: cut connections are made good, and every byte is verified.

A file is written as NAME.part, and gets its name when its SHA-256 is right. Failures, and what follows:

the connection is cut, or silent for SILENT_S
    Another one, with backoff, from the next byte on. Given up after `give_up_after_s` without progress.
a chunk has a wrong CRC-32C, or is not the next one
    The same. The bytes before it are kept.
the whole has a wrong SHA-256
    Once more from the first byte: what an earlier export had left may be damaged. Then `GatewayFailed`.
the file is another one by now, deleted, or unreadable on the robot
    `Refused`. What was received stays as NAME.part.
cancelled
    NAME.part stays, and another export goes on from there.
"""

import asyncio
import hashlib
import os
import time
from collections.abc import Awaitable, Callable
from contextlib import aclosing
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, Final

from common.backoff import Backoff
from common.errors import UserError
from console.client.errors import DeadlineExceeded, GatewayError, GatewayFailed, Overloaded, Unreachable
from console.client.export_path import path_below
from console.client.file_stream import ExportTransport, file_bytes
from console.client.results import Recording, RecordingFile, RecordingKind, RecordingState

_FIRST_PAUSE_S: Final = 0.2
_LONGEST_PAUSE_S: Final = 5.0
_READ_BYTES: Final = 1024 * 1024
_ASKED_AGAIN_S: Final = 1.0
_SLOWEST_READ: Final = 20 * 1024 * 1024
"""Bytes a second that any disk of a robot reads, at least."""
_REASONS_TO_WAIT: Final = frozenset({"RECORDER_UNREACHABLE", "TOO_MANY_EXPORTS"})
"""Refusals that end by themselves."""


@dataclass(frozen=True, slots=True)
class ExportProgress:
    """How far an export is.

    Attributes:
        file: Being copied; of `files`, this is number `number`, from 1.
        done, total: Bytes of all files; `done` includes what was there before.
        cuts: Connections that were made anew.
        waiting: Why nothing comes at the moment; empty while something does.
    """

    file: str
    number: int
    files: int
    done: int
    total: int
    cuts: int = 0
    waiting: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """How to copy a recording."""

    resume: bool = True
    """Goes on with what an earlier export has left. Otherwise a folder that is there is refused."""
    max_bytes_per_s: int = 0
    """0: as configured on the robot."""
    give_up_after_s: float = 120.0
    """Without a byte."""
    progress: Callable[[ExportProgress], None] = lambda _: None
    """Called after each chunk."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportedRecording:
    """A recording that was copied.

    Attributes:
        folder: On this computer.
        files: Number of files that are there, each verified.
        size: Of these, in bytes.
        received: Bytes that this export has received, those that came twice included.
        cuts: Connections that were made anew.
        not_final: Names of files that the robot is still writing, and that are not copied therefore.
    """

    folder: Path
    files: int
    size: int
    received: int
    cuts: int
    not_final: tuple[str, ...]


@dataclass(slots=True)
class _Partial:
    """What has arrived of a file: on the disk as NAME.part, and its digest."""

    stream: IO[bytes]
    size: int = 0
    digest: Any = field(default_factory=hashlib.sha256)

    def append(self, data: bytes) -> None:
        rest = memoryview(data)
        while rest:
            # A disk that becomes full takes a part, and refuses only the next write.
            rest = rest[self.stream.write(rest) :]
        self.count(data)

    def count(self, data: bytes) -> None:
        """Takes in what is on the disk already."""
        self.digest.update(data)
        self.size += len(data)

    def empty(self) -> None:
        self.stream.seek(0)
        self.stream.truncate()
        self.size, self.digest = 0, hashlib.sha256()

    def sync(self) -> None:
        self.stream.flush()
        os.fsync(self.stream.fileno())


class FolderTakenError(UserError):
    """The folder of an export that does not resume an earlier one is there already."""


class Export:
    """One copy of a recording.

    Args:
        transport: Carries the streams out.
        recording: With its files.
        folder: Where to write them.
        options: How.
        clock: Monotonic seconds.
    """

    def __init__(
        self,
        transport: ExportTransport,
        recording: Recording,
        folder: Path,
        options: ExportOptions,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._transport = transport
        self._recording = recording
        self._folder = folder
        self._options = options
        self._clock = clock
        self._files = tuple(each for each in recording.files if each.final)
        self._total = sum(each.size for each in self._files)
        self._finished = self._received = self._cuts = 0

    async def run(self) -> ExportedRecording:
        """Copies all final files.

        Raises:
            GatewayError: The robot refuses or can't be reached, or a file can't be verified.
            FolderTakenError: The folder is there already.
            UserError: It can't be written.
        """
        # All names, before the first byte is written.
        paths = [path_below(self._folder, each.name) for each in self._files]
        if not self._options.resume and self._folder.exists():
            raise FolderTakenError(
                f"{self._folder} is there already",
                "Resume what an earlier export has left, or choose another folder",
            )
        try:
            for number, (file, path) in enumerate(zip(self._files, paths, strict=True), start=1):
                await self._copy(file, path, number)
                self._finished += file.size
        except OSError as error:
            raise UserError(
                f"{error.filename or self._folder} can't be written: {error.strerror or error}",
                "Free space there, or choose another folder; what was received stays",
            ) from None
        return ExportedRecording(
            folder=self._folder,
            files=len(self._files),
            size=self._total,
            received=self._received,
            cuts=self._cuts,
            not_final=tuple(each.name for each in self._recording.files if not each.final),
        )

    async def _copy(self, file: RecordingFile, path: Path, number: int) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        if await asyncio.to_thread(os.path.lexists, path):
            await self._check_present(file, path)
            self._report(file, number, file.size)
            return
        partial_path = path.with_name(f"{path.name}.part")
        # Never through a link, which another user of the folder may have put there.
        descriptor = os.open(partial_path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o644)
        with os.fdopen(descriptor, "r+b", buffering=0) as stream:
            partial = _Partial(stream)
            await self._take_present(partial, file)
            for _ in range(2):
                await self._receive(partial, file, number)
                if partial.digest.digest() == file.sha256:
                    break
                partial.empty()
            else:
                partial_path.unlink()
                raise GatewayFailed(
                    f"{file.name} arrived twice with another SHA-256 than the robot has computed",
                    "Check the disk and memory of where it comes from; the file is not kept",
                )
            await asyncio.to_thread(partial.sync)
        partial_path.replace(path)

    async def _check_present(self, file: RecordingFile, path: Path) -> None:
        digest = await asyncio.to_thread(_digest_of, path)
        if digest != file.sha256:
            raise UserError(
                f"{path} is there already, with other content than the robot's",
                "Move it away, or choose another folder",
            )

    async def _take_present(self, partial: _Partial, file: RecordingFile) -> None:
        """Takes what an earlier export has left."""
        while data := await asyncio.to_thread(partial.stream.read, _READ_BYTES):
            partial.count(data)
        if partial.size > file.size:
            partial.empty()

    async def _receive(self, partial: _Partial, file: RecordingFile, number: int) -> None:
        """Receives what is missing, over as many connections as it takes."""
        backoff = Backoff(_FIRST_PAUSE_S, _LONGEST_PAUSE_S)
        progress_s, reached = self._clock(), partial.size
        while partial.size < file.size:
            try:
                await self._receive_once(partial, file, number)
            except GatewayError as error:
                if not _may_pass(error):
                    raise
                if partial.size > reached:
                    progress_s, reached = self._clock(), partial.size
                    backoff.reset()
                pause_s = backoff.next_s()
                if self._clock() + pause_s - progress_s > self._options.give_up_after_s:
                    raise
                self._cuts += 1
                self._report(file, number, partial.size, str(error.what))
                await self._transport.sleep(pause_s)

    async def _receive_once(self, partial: _Partial, file: RecordingFile, number: int) -> None:
        chunks = file_bytes(
            self._transport,
            self._recording.id,
            file,
            partial.size,
            max_bytes_per_s=self._options.max_bytes_per_s,
        )
        async with aclosing(chunks):
            async for data in chunks:
                self._received += len(data)
                await _to_the_end(partial.append, data)
                self._report(file, number, partial.size)

    def _report(self, file: RecordingFile, number: int, size: int, waiting: str = "") -> None:
        self._options.progress(
            ExportProgress(
                file.name,
                number,
                len(self._files),
                self._finished + size,
                self._total,
                self._cuts,
                waiting,
            )
        )


async def once_read(
    recording: Recording,
    ask: Callable[[str], Awaitable[Recording]],
    sleep: Callable[[float], Awaitable[None]],
    options: ExportOptions,
) -> Recording:
    """Returns a recording whose files have sums: a robot reads those of its own experiments when it is asked.

    Args:
        recording: With its files.
        ask: Returns it anew.
        sleep: Pauses.
        options: `progress` gets what is being waited for.

    Raises:
        GatewayError: The robot refuses, or no longer answers.
    """
    until_s = time.monotonic() + options.give_up_after_s + recording.size / _SLOWEST_READ
    while _is_being_read(recording) and time.monotonic() < until_s:
        read = sum(file.final for file in recording.files)
        options.progress(
            ExportProgress(
                "", read, len(recording.files), 0, recording.size, waiting="the robot reads the files"
            )
        )
        await sleep(_ASKED_AGAIN_S)
        try:
            recording = await ask(recording.id)
        except GatewayError as error:
            if not _may_pass(error):
                raise
    return recording


def _is_being_read(recording: Recording) -> bool:
    """Whether files of a run bundle that has ended still have no sums."""
    bundle = recording.kind is RecordingKind.RUN_BUNDLE
    ended = recording.state is not RecordingState.RECORDING
    return bundle and ended and not all(file.final for file in recording.files)


async def _to_the_end(write: Callable[[bytes], None], data: bytes) -> None:
    """Writes in a thread: a slow disk must not keep the loop, which may be driving.

    Cancelled, it waits for the end of the write, because the file is closed next.
    """
    writing = asyncio.ensure_future(asyncio.to_thread(write, data))
    try:
        await asyncio.shield(writing)
    except asyncio.CancelledError:
        await asyncio.wait((writing,))
        raise


def _may_pass(error: GatewayError) -> bool:
    return isinstance(error, Unreachable | DeadlineExceeded | Overloaded) or error.reason in _REASONS_TO_WAIT


def _digest_of(path: Path) -> bytes:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").digest()
