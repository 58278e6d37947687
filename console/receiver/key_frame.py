"""Decodes one key frame into a small picture, in a process of its own.

The frame comes from another computer and can be anything: a decoder that crashes, hangs or fills the memory
does so in a child with limits. What comes back has a fixed size, so that nothing has to parse it.
"""

import asyncio
import tempfile
from pathlib import Path
from typing import Final

from common import trial

WIDTH_PX: Final = 160
HEIGHT_PX: Final = 90
PICTURE_BYTES: Final = 4 * WIDTH_PX * HEIGHT_PX
"""BGRx without padding."""
CODECS: Final = ("h264", "h265")
MOST_BYTES: Final = 2 * 1024 * 1024
"""Of a key frame: what the contract permits (GetRecordingThumbnailResponse)."""
DECODED_WITHIN_S: Final = 8.0
"""Start of the process and GStreamer included."""


async def small_picture(key_frame: bytes, codec: str, within_s: float = DECODED_WITHIN_S) -> bytes:
    """Returns a picture of WIDTH_PX x HEIGHT_PX in BGRx, with borders where its shape is another one.

    Cancelling it kills the child.

    Args:
        key_frame: with its parameter sets, as an Annex B byte stream.
        codec: as another computer names it.
        within_s: deadline of all.

    Raises:
        TrialError: it can't be decoded; the text says why.
    """
    if codec not in CODECS:
        raise trial.TrialError(f"its codec {codec[:20]!r} is not known")
    if not 0 < len(key_frame) <= MOST_BYTES:
        raise trial.TrialError(f"it has {len(key_frame)} bytes")
    try:
        with tempfile.TemporaryDirectory(prefix="robotctl-") as directory:
            return await _decoded(Path(directory), key_frame, codec, within_s)
    except OSError as error:
        raise trial.TrialError(f"this computer's disk: {error.strerror}", passing=True) from error


async def _decoded(directory: Path, key_frame: bytes, codec: str, within_s: float) -> bytes:
    source, target = directory / "frame", directory / "picture"
    await asyncio.to_thread(source.write_bytes, key_frame)
    await trial.run(within_s, "console.receiver.key_frame_trial", codec, str(source), str(target))
    with target.open("rb") as file:
        picture = await asyncio.to_thread(file.read, PICTURE_BYTES + 1)
    if len(picture) != PICTURE_BYTES:
        raise trial.TrialError("it decodes to no picture")
    return picture
