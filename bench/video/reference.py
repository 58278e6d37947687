"""The reference: today's usual pipeline, a gst-launch-1.0 sender and a plain receiver."""

import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from types import TracebackType
from typing import Any, Self

from bench.video import foreign
from bench.video.camera import HEIGHT_PX, WIDTH_PX, Camera
from common.gst import Gst
from console.receiver.errors import StreamEndedError
from console.receiver.frame import Frame
from console.receiver.frame_queue import FrameQueue

PLAIN_X264 = "x264enc tune=zerolatency speed-preset=veryfast bitrate=2500 key-int-max=30"
KEY_FRAMES_APART_S = 1.0
"""What that makes of 30 frames per second."""


@contextmanager
def sender(
    source: Camera, port: int, latency_ms: int, encoder: str = PLAIN_X264
) -> Iterator[subprocess.Popen[bytes]]:
    """Sends until the block ends."""
    description = (
        f"{source.source} ! {encoder} ! h264parse config-interval=-1 ! mpegtsmux alignment=7"
        f" ! srtsink uri=srt://127.0.0.1:{port}?mode=listener latency={latency_ms}"
        " wait-for-connection=false sync=false"
    )
    with foreign.running("gst-launch-1.0", "-q", *description.split()) as process:
        yield process


class PlainViewer:
    """srtsrc ! tsdemux ! h264parse ! avdec_h264, as it comes."""

    def __init__(self, port: int, latency_ms: int) -> None:
        self._queue = FrameQueue(4)
        self._pipeline = Gst.parse_launch(
            f"srtsrc uri=srt://127.0.0.1:{port}?mode=caller latency={latency_ms}"
            " ! tsdemux ! h264parse ! avdec_h264 ! appsink name=out sync=false emit-signals=true"
        )
        self._out = self._pipeline.get_by_name("out")
        self._handler = self._out.connect("new-sample", self._on_sample)
        self._pipeline.set_state(Gst.State.PLAYING)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pipeline.set_state(Gst.State.NULL)
        self._out.disconnect(self._handler)

    def next_frame(self, timeout_s: float) -> Frame:
        """The next decoded frame."""
        taken = self._queue.take(time.monotonic() + timeout_s)
        if not isinstance(taken, Frame):
            raise StreamEndedError("the reference sends nothing", "See what gst-launch-1.0 printed")
        return taken

    def _on_sample(self, sink: Any) -> Any:
        arrival_s = time.monotonic()
        buffer = sink.emit("pull-sample").get_buffer()
        luma = partial(buffer.extract_dup, 0, WIDTH_PX * HEIGHT_PX)
        self._queue.put(Frame(WIDTH_PX, HEIGHT_PX, "h264", None, arrival_s, False, WIDTH_PX, luma))
        return Gst.FlowReturn.OK
