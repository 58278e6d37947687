"""The process of the camera; see camera.py."""

import argparse
import mmap
import signal
import struct
import time
from collections.abc import Iterator
from itertools import chain, count
from pathlib import Path
from typing import Final

from bench.video import stamp
from bench.video.camera import FRAME_BYTES, WIDTH_PX, caps
from common.gst import GLib, Gst

_ENDINGS: Final = (signal.SIGINT, signal.SIGTERM)


def serve(footage: Path, socket: Path, journal: Path, fps: int) -> None:
    """Offers frames until SIGTERM; prints "ready" as soon as readers may connect."""
    # Waited for, not handled: an event that a handler sets in the midst of its own wait is locked for ever.
    # Blocked before there is another thread, so that no thread takes them.
    signal.pthread_sigmask(signal.SIG_BLOCK, _ENDINGS)
    pipeline = Gst.parse_launch(
        "appsrc name=in is-live=true format=time max-bytes=0"
        f" caps={caps(fps)}"
        f" ! shmsink socket-path={socket} shm-size={8 * FRAME_BYTES} wait-for-connection=false sync=false"
    )
    way_in = pipeline.get_by_name("in")
    pipeline.set_state(Gst.State.PLAYING)
    print("ready", flush=True)
    for frame in _frames(footage, journal, fps):
        way_in.emit("push-buffer", Gst.Buffer.new_wrapped_bytes(GLib.Bytes.new(frame)))
    pipeline.set_state(Gst.State.NULL)


def _frames(footage: Path, journal: Path, fps: int) -> Iterator[bytes]:
    """Yields stamped frames at their time until a signal; forth and back, so that the content never jumps."""
    with (
        footage.open("rb") as file,
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content,
        journal.open("wb", buffering=0) as captured,
    ):
        available = len(content) // FRAME_BYTES
        order = [*range(available), *range(available - 2, 0, -1)]
        begun_s = time.monotonic()
        for number, index in zip(count(), chain.from_iterable(order for _ in count()), strict=False):
            due_s = begun_s + number / fps
            if signal.sigtimedwait(_ENDINGS, max(0.0, due_s - time.monotonic())):
                return
            frame = bytearray(content[index * FRAME_BYTES : (index + 1) * FRAME_BYTES])
            captured.write(struct.pack("d", stamp.draw(frame, WIDTH_PX, time.monotonic())))
            yield bytes(frame)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("footage", type=Path)
    parser.add_argument("socket", type=Path)
    parser.add_argument("journal", type=Path)
    parser.add_argument("fps", type=int)
    given = parser.parse_args()
    serve(given.footage, given.socket, given.journal, given.fps)
