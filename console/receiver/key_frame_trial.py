"""Decodes one key frame, in the child process of common.trial that console.receiver.key_frame starts."""

import resource
import time
from pathlib import Path
from typing import Any, Final

from common.gst import GLib, Gst
from common.trial_child import report
from console.receiver.key_frame import HEIGHT_PX, PICTURE_BYTES, WIDTH_PX

_DECODED_WITHIN_S: Final = 5.0
_POLL_NS: Final = 50_000_000
_MOST_CPU_S: Final = 6
_MOST_MEMORY_BYTES: Final = 2 << 30
"""Address space: libraries take some hundred MiB of it, a frame of 8192x8192 less than 200."""


def main(codec: str, source: str, target: str) -> None:
    """Decodes the frame in `source` and writes its picture to `target`."""
    resource.setrlimit(resource.RLIMIT_AS, (_MOST_MEMORY_BYTES, _MOST_MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (_MOST_CPU_S, _MOST_CPU_S))
    resource.setrlimit(resource.RLIMIT_FSIZE, (PICTURE_BYTES, PICTURE_BYTES))
    # Kept until the end: a pipeline that is dropped while it plays is torn down badly.
    pipeline = Gst.parse_launch(
        f"appsrc name=in caps=video/x-{codec},stream-format=byte-stream,alignment=au"
        f" ! {codec}parse ! avdec_{codec} max-threads=1 ! videoconvert ! videoscale add-borders=true"
        f" ! video/x-raw,format=BGRx,width={WIDTH_PX},height={HEIGHT_PX},pixel-aspect-ratio=1/1"
        " ! appsink name=out sync=false"
    )
    report(_decode(pipeline, Path(source).read_bytes(), Path(target)))


def _decode(pipeline: Any, key_frame: bytes, target: Path) -> str:
    """Returns why there is no picture; empty if there is one."""
    pipeline.set_state(Gst.State.PLAYING)
    source, sink = pipeline.get_by_name("in"), pipeline.get_by_name("out")
    source.emit("push-buffer", Gst.Buffer.new_wrapped_bytes(GLib.Bytes.new(key_frame)))
    source.emit("end-of-stream")
    deadline_s = time.monotonic() + _DECODED_WITHIN_S
    while time.monotonic() < deadline_s:
        if sample := sink.emit("try-pull-sample", _POLL_NS):
            buffer = sample.get_buffer()
            target.write_bytes(buffer.extract_dup(0, buffer.get_size()))
            return ""
        if message := pipeline.get_bus().pop_filtered(Gst.MessageType.ERROR | Gst.MessageType.EOS):
            failed = message.type == Gst.MessageType.ERROR
            return str(message.parse_error()[0].message) if failed else "it has no frame"
    return "it is not decoded in time"
