"""Pictures for a list of recordings: decoded once, then kept on this computer's disk.

A picture is found again by the SHA-256 of its recording, so that it is right whatever the robot is called.
The folder has at most MOST_KEPT of them; those that were written first give way.
"""

import asyncio
import hashlib
import os
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path
from typing import Final

from common.errors import UserError
from common.private_files import make_own_directory, write_private
from common.trial import TrialError
from console.client import Recording
from console.client.results import RecordingThumbnail
from console.receiver.key_frame import PICTURE_BYTES, small_picture

MOST_KEPT: Final = 256
"""15 MB."""
_SUFFIX: Final = ".bgrx"

Fetch = Callable[[], Awaitable[RecordingThumbnail]]
"""Fetches the key frame. Raises a `GatewayError`."""


def cache_directory() -> Path:
    """Returns $XDG_CACHE_HOME/robotctl/thumbnails; ~/.cache where that is unset or not absolute."""
    configured = Path(os.environ.get("XDG_CACHE_HOME", ""))
    base = configured if configured.is_absolute() else Path.home() / ".cache"
    return base / "robotctl" / "thumbnails"


class Thumbnails:
    """Makes the pictures, and keeps them.

    Args:
        directory: of the pictures; by default this user's cache.
        decode: makes a picture of a key frame and its codec.
    """

    def __init__(
        self,
        directory: Path | None = None,
        decode: Callable[[bytes, str], Awaitable[bytes]] = small_picture,
    ) -> None:
        self._directory = directory or cache_directory()
        self._decode = decode

    async def picture(self, recording: Recording, fetch: Fetch) -> bytes:
        """Returns the picture of a recording that has ended; empty where it can't be made.

        Raises:
            GatewayError: the key frame can't be fetched.
        """
        path = self._directory / (_name(recording) + _SUFFIX)
        if kept := await asyncio.to_thread(_read, path):
            return kept
        fetched = await fetch()
        try:
            picture = await self._decode(fetched.key_frame, fetched.format)
        except TrialError:
            # The next window tries again: the cause may be the state of this computer.
            return b""
        await asyncio.to_thread(self._keep, path, picture)
        return picture

    def _keep(self, path: Path, picture: bytes) -> None:
        """Writes a picture; a disk that refuses costs another decoding, no more."""
        with suppress(OSError, UserError):
            make_own_directory(self._directory)
            write_private(path, picture)
            kept = sorted(self._directory.glob(f"*{_SUFFIX}"), key=lambda each: each.lstat().st_mtime)
            for oldest in kept[:-MOST_KEPT]:
                oldest.unlink(missing_ok=True)


def _name(recording: Recording) -> str:
    return hashlib.sha256(recording.id.encode() + recording.sha256).hexdigest()


def _read(path: Path) -> bytes:
    """Returns a picture that is kept; empty without one, or where the file is something else."""
    try:
        with path.open("rb") as file:
            picture = file.read(PICTURE_BYTES + 1)
    except OSError:
        return b""
    return picture if len(picture) == PICTURE_BYTES else b""
