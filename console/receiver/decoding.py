"""Decodes one compressed stream into frames without waiting for the next one."""

import time
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias

from common.errors import UserError
from common.gst import Gst, GstVideo, stop_element
from console.receiver.frame import Frame
from console.receiver.frame_queue import FrameQueue
from console.receiver.options import ReceiverOptions


class Origin(NamedTuple):
    """What is known of a frame apart from its pixels.

    Attributes:
        capture_ns: as in `Frame`.
        received_s: as in `Frame`.
        torn: whether it, or a frame that it depends on, lacks something.
    """

    capture_ns: int | None = None
    received_s: float | None = None
    torn: bool = False


Origins: TypeAlias = Callable[[int], Origin]
CODECS = {"video/x-h264": "h264", "video/x-h265": "h265"}
"""Codec by media type of its stream; GStreamer's parser, software decoder and caps are named after it."""
_BAD = "gstreamer1.0-plugins-bad"
_PACKAGES = {
    "capssetter": "gstreamer1.0-plugins-good",
    "avdec_h264": "gstreamer1.0-libav",
    "avdec_h265": "gstreamer1.0-libav",
    "videoconvert": "gstreamer1.0-plugins-base",
    "appsink": "gstreamer1.0-plugins-base",
    "tee": "libgstreamer1.0-0",
    "queue": "libgstreamer1.0-0",
    "fdsink": "libgstreamer1.0-0",
}
"""Debian's package of each element; those that are missing here are in _BAD."""


def element(factory: str, **properties: Any) -> Any:
    """Makes a GStreamer element; properties that this version doesn't know are left alone.

    Texts are read as on a gst-launch-1.0 command line, so they can name flags and caps.

    Raises:
        UserError: it is not installed.
    """
    made = Gst.ElementFactory.make(factory, None)
    if made is None:
        raise UserError(
            f"GStreamer's element {factory} is missing",
            f"Type: sudo apt-get install {_PACKAGES.get(factory, _BAD)}",
        )
    for name, value in properties.items():
        dashed = name.replace("_", "-")
        if not made.find_property(dashed):
            continue
        if isinstance(value, str):
            Gst.util_set_object_arg(made, dashed, value)
        else:
            made.set_property(dashed, value)
    return made


class DecodingBranch:
    """Parser, decoder and appsink for one elementary stream of the transport stream.

    Two things keep a frame from waiting for its successor. The sender writes one access unit per PES
    packet, so capssetter declares the parser's input as whole access units; and the decoder's threads share
    the slices of one frame instead of working at several frames.

    Args:
        codec: of the stream, "h264" or "h265".
        queue: takes every frame, on a GStreamer thread.
        options: pixel format and decoders.
        source: element that provides whole access units; None to take them from the pad of `attach`.
        origins: returns the origin of a frame, for its presentation time; called once for each.

    Raises:
        UserError: an element is not installed.
    """

    def __init__(
        self,
        codec: str,
        queue: FrameQueue,
        options: ReceiverOptions,
        source: Any = None,
        origins: Origins | None = None,
    ) -> None:
        self._codec = codec
        self._origins = origins or _unknown
        self._queue = queue
        self._decoder = options.decoders.get(codec, f"avdec_{codec}")
        self._caps: Any = None
        self._layout: Any = None
        caps = f"video/x-raw,format={options.pixels.value}"
        self._sink = element("appsink", sync=False, emit_signals=True, max_buffers=1, drop=True, caps=caps)
        # A branch is added while the pipeline plays: waiting for its first frame would pause a live source,
        # and no frame would come. `async` is a keyword of Python's.
        self._sink.set_property("async", False)
        self._handler = self._sink.connect("new-sample", self._on_sample)
        self._elements = [
            source or element("capssetter", caps=f"video/x-{codec},alignment=au"),
            element(f"{codec}parse"),
            element(self._decoder, thread_type="slice"),
            element("videoconvert"),
            self._sink,
        ]

    def attach(self, pipeline: Any, pad: Any = None) -> None:
        """Adds the branch, behind `pad` if there is one, and starts it."""
        for one in self._elements:
            pipeline.add(one)
        for upstream, downstream in pairwise(self._elements):
            upstream.link(downstream)
        for one in reversed(self._elements):
            one.sync_state_with_parent()
        if pad:
            pad.link(self._elements[0].get_static_pad("sink"))

    def detach(self, pipeline: Any) -> None:
        """Stops and removes the branch. Not on a GStreamer thread."""
        self._sink.disconnect(self._handler)
        for one in self._elements:
            stop_element(one)
            pipeline.remove(one)

    def owns(self, element: Any) -> bool:
        """Whether an element belongs to this branch; those inside a decoder bin count as the decoder."""
        return any(element is one or element.has_as_ancestor(one) for one in self._elements)

    def _on_sample(self, sink: Any) -> Any:
        arrival_s = time.monotonic()
        sample = sink.emit("pull-sample")
        if sample is None:
            return Gst.FlowReturn.EOS
        self._queue.put(self._frame(sample, arrival_s))
        return Gst.FlowReturn.OK

    def _frame(self, sample: Any, arrival_s: float) -> Frame:
        caps = sample.get_caps()
        if self._caps is None or not caps.is_equal(self._caps):
            self._caps, self._layout = caps, GstVideo.VideoInfo.new_from_caps(caps)
        info = self._layout
        buffer = sample.get_buffer()
        pts_ns = None if buffer.pts == Gst.CLOCK_TIME_NONE else buffer.pts
        origin = Origin() if pts_ns is None else self._origins(pts_ns)
        return Frame(
            width=info.width,
            height=info.height,
            codec=self._codec,
            pts_ns=pts_ns,
            arrival_s=arrival_s,
            # Few decoders set the flag: those of FFmpeg do not.
            corrupt=origin.torn or buffer.has_flags(Gst.BufferFlags.CORRUPTED),
            stride=info.stride[0],
            read=partial(_pixels, buffer),
            decoder=self._decoder,
            capture_ns=origin.capture_ns,
            received_s=origin.received_s,
        )


def _unknown(_pts_ns: int) -> Origin:
    return Origin()


def _pixels(buffer: Any) -> bytes:
    """Copies a buffer's memory: mapping it takes a quarter of the time of Gst.Buffer.extract_dup."""
    mapped, content = buffer.map(Gst.MapFlags.READ)
    if not mapped:
        raise RuntimeError("a decoded frame can't be read")
    try:
        return bytes(content.data)
    finally:
        buffer.unmap(content)
