"""From one compressed stream to pictures, without waiting for the next one."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from common.errors import UserError
from common.gst import Gst, GstVideo
from console.receiver.frame import Frame, PixelFormat, Plane
from console.receiver.setup import Setup


@dataclass(frozen=True, slots=True)
class Codec:
    """What one kind of stream needs.

    Args:
        name: "h264" or "h265".
        caps: media type of the stream.
        parser: element that finds the parameter sets.
        decoder: element that makes the pictures in software.
    """

    name: str
    caps: str
    parser: str
    decoder: str


CODECS = {
    codec.caps: codec
    for codec in (
        Codec("h264", "video/x-h264", "h264parse", "avdec_h264"),
        Codec("h265", "video/x-h265", "h265parse", "avdec_h265"),
    )
}

_PACKAGES = {
    "srtsrc": "gstreamer1.0-plugins-bad",
    "tsdemux": "gstreamer1.0-plugins-bad",
    "capssetter": "gstreamer1.0-plugins-good",
    "h264parse": "gstreamer1.0-plugins-bad",
    "h265parse": "gstreamer1.0-plugins-bad",
    "avdec_h264": "gstreamer1.0-libav",
    "avdec_h265": "gstreamer1.0-libav",
    "videoconvert": "gstreamer1.0-plugins-base",
    "appsink": "gstreamer1.0-plugins-base",
    "tee": "libgstreamer1.0-0",
    "queue": "libgstreamer1.0-0",
    "fdsink": "libgstreamer1.0-0",
}


def element(factory: str, **properties: Any) -> Any:
    """A new GStreamer element; properties that this version doesn't know are left alone.

    Texts are read as on a gst-launch-1.0 command line, so they can name flags and caps.

    Raises:
        UserError: it is not installed.
    """
    made = Gst.ElementFactory.make(factory, None)
    if made is None:
        raise UserError(
            f"GStreamer's element {factory} is missing",
            f"Type: sudo apt-get install {_PACKAGES.get(factory, 'gstreamer1.0-plugins-bad')}",
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


class _Memory:
    """The memory of a GStreamer buffer."""

    def __init__(self, buffer: Any) -> None:
        self._buffer = buffer

    def extract_dup(self, offset: int, size: int, /) -> bytes:
        """Copies a part, or all of it: that in a way that takes a quarter of the time."""
        if (offset, size) != (0, self._buffer.get_size()):
            return bytes(self._buffer.extract_dup(offset, size))
        mapped, content = self._buffer.map(Gst.MapFlags.READ)
        if not mapped:
            raise RuntimeError("a decoded picture can't be read")
        try:
            return bytes(content.data)
        finally:
            self._buffer.unmap(content)


class DecodingBranch:
    """Parser, decoder and the way out for one stream of the transport stream.

    Two things keep a picture from waiting for its successor. The sender writes one access unit per PES
    packet, so the parser is told that what comes is whole; and the decoder's threads share the slices of one
    picture instead of working at several pictures.

    Args:
        codec: of the stream.
        deliver: called on a GStreamer thread with every picture.
        setup: what the caller wants of the pictures.

    Raises:
        UserError: an element is not installed.
    """

    def __init__(self, codec: Codec, deliver: Callable[[Frame], None], setup: Setup) -> None:
        self._codec = codec
        self._deliver = deliver
        self._pixels = setup.pixels
        self._decoder = setup.decoders.get(codec.name, codec.decoder)
        self._caps: Any = None
        self._layout: Any = None
        caps = f"video/x-raw,format={self._pixels.value}"
        sink = element("appsink", sync=False, emit_signals=True, max_buffers=1, drop=True, caps=caps)
        self._sink = sink
        self._handler = sink.connect("new-sample", self._on_sample)
        self._elements = [
            element("capssetter", caps=f"{codec.caps},alignment=au"),
            element(codec.parser),
            element(self._decoder, thread_type="slice"),
            element("videoconvert"),
            sink,
        ]

    def attach(self, pipeline: Any, pad: Any) -> None:
        """Joins the pipeline behind `pad` and runs."""
        for one in self._elements:
            pipeline.add(one)
        for upstream, downstream in zip(self._elements, self._elements[1:], strict=False):
            upstream.link(downstream)
        for one in reversed(self._elements):
            one.sync_state_with_parent()
        pad.link(self._elements[0].get_static_pad("sink"))

    def detach(self, pipeline: Any) -> None:
        """Leaves the pipeline. Not on a GStreamer thread."""
        self._sink.disconnect(self._handler)
        for one in self._elements:
            one.set_locked_state(True)
            one.set_state(Gst.State.NULL)
            pipeline.remove(one)

    def is_mine(self, element: Any) -> bool:
        """Whether an element is one of this branch; those inside a decoder count as the decoder."""
        return any(element is one or element.has_as_ancestor(one) for one in self._elements)

    def _on_sample(self, sink: Any) -> Any:
        arrival_s = time.monotonic()
        sample = sink.emit("pull-sample")
        if sample is None:
            return Gst.FlowReturn.EOS
        self._deliver(self._frame(sample, arrival_s))
        return Gst.FlowReturn.OK

    def _frame(self, sample: Any, arrival_s: float) -> Frame:
        caps = sample.get_caps()
        if self._caps is None or not caps.is_equal(self._caps):
            self._caps, self._layout = caps, GstVideo.VideoInfo.new_from_caps(caps)
        info = self._layout
        buffer = sample.get_buffer()
        return Frame(
            width=info.width,
            height=info.height,
            codec=self._codec.name,
            pts_ns=None if buffer.pts == Gst.CLOCK_TIME_NONE else buffer.pts,
            arrival_s=arrival_s,
            corrupt=buffer.has_flags(Gst.BufferFlags.CORRUPTED),
            planes=_planes(info, self._pixels),
            pixels=_Memory(buffer),
            pixel_format=self._pixels,
            decoder=self._decoder,
        )


def _planes(info: Any, pixels: PixelFormat) -> tuple[Plane, ...]:
    if pixels is PixelFormat.BGRX:
        return (Plane(info.offset[0], info.stride[0], info.height),)
    half = (info.height + 1) // 2
    return tuple(
        Plane(info.offset[i], info.stride[i], rows) for i, rows in enumerate((info.height, half, half))
    )
