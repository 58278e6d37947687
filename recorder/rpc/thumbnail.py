"""A picture of a recording: the first key frame of its video."""

from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from typing import Final

from recorder.mcap.reading import messages
from recorder.store.manifest import Manifest
from recorder.values import VIDEO_TOPIC
from recorder.video.access_unit import Codec, content
from recorder.video.message import decode

MAX_BYTES: Final = 2 * 1024 * 1024
_MAX_FRAMES: Final = 900
"""Looked at in all: a key frame comes every two seconds, of at most 120 frames each."""
_NS_PER_MS: Final = 1_000_000


@dataclass(frozen=True, slots=True)
class Thumbnail:
    """One coded key frame with its parameter sets; `format` is "h264" or "h265"."""

    key_frame: bytes
    format: str
    captured_unix_ms: int


def find_thumbnail(folder: Path, manifest: Manifest) -> Thumbnail | None:
    """Returns the first key frame of at most 2 MiB in the final segments; None without one. For a thread.

    Raises:
        OSError: the disk fails.
    """
    video = {index for index, topic in enumerate(manifest.topics) if topic.name == VIDEO_TOPIC}
    names = [each.name for each in manifest.segments if not video.isdisjoint(each.counts)]
    frames = chain.from_iterable(messages(folder / name, VIDEO_TOPIC) for name in names)
    for _, data in islice(frames, _MAX_FRAMES):
        frame = decode(data)
        if frame is None or len(frame.unit) > MAX_BYTES:
            continue
        if content(Codec(frame.codec), frame.unit).decodable:
            return Thumbnail(frame.unit, frame.codec, frame.captured_ns // _NS_PER_MS)
    return None
