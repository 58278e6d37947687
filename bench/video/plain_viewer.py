"""A receiver of the simplest kind with GStreamer: a pipeline, decoded frames out of an appsink."""

import time
from functools import partial
from types import TracebackType
from typing import Any, Self

from bench.video.camera import HEIGHT_PX, WIDTH_PX
from common.gst import Gst, stop
from console.receiver.errors import StreamEndedError
from console.receiver.frame import Frame
from console.receiver.frame_queue import FrameQueue

APPSINK = "appsink name=out sync=false emit-signals=true"
"""End of every description, behind the decoder."""


class PlainViewer:
    """Plays a pipeline until its block ends.

    Args:
        pipeline: a description that ends in APPSINK, or a pipeline with such an element.
    """

    def __init__(self, pipeline: Any) -> None:
        self._queue = FrameQueue(4)
        self._pipeline = Gst.parse_launch(pipeline) if isinstance(pipeline, str) else pipeline
        self._out = self._pipeline.get_by_name("out")
        self._handler = self._out.connect("new-sample", self._on_sample)
        self._pipeline.set_state(Gst.State.PLAYING)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        stop(self._pipeline)
        self._out.disconnect(self._handler)

    def next_frame(self, timeout_s: float) -> Frame:
        """Returns the next decoded frame.

        Raises:
            StreamEndedError: none came in time.
        """
        taken = self._queue.take(time.monotonic() + timeout_s)
        if not isinstance(taken, Frame):
            raise StreamEndedError("the sender sends nothing", "See what it printed")
        return taken

    def _on_sample(self, sink: Any) -> Any:
        arrival_s = time.monotonic()
        buffer = sink.emit("pull-sample").get_buffer()
        luma = partial(buffer.extract_dup, 0, WIDTH_PX * HEIGHT_PX)
        corrupt = buffer.has_flags(Gst.BufferFlags.CORRUPTED)
        self._queue.put(Frame(WIDTH_PX, HEIGHT_PX, "h264", None, arrival_s, corrupt, WIDTH_PX, luma))
        return Gst.FlowReturn.OK
