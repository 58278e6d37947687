"""GStreamer as an independent judge of recorded video: its parser and libav's decoder, no part of ours."""

from collections.abc import Sequence

from common.gst import Gst

_WITHIN_S = 20
_FRAME_NS = 33_333_333


def decoded_frames(units: Sequence[bytes]) -> int:
    """How many pictures avdec_h264 makes of access units; fails where an element complains of them."""
    pipeline = Gst.parse_launch(
        "appsrc name=in format=time caps=video/x-h264,stream-format=byte-stream,alignment=au"
        " ! h264parse ! avdec_h264 output-corrupt=false ! appsink name=out sync=false"
    )
    source, sink = pipeline.get_by_name("in"), pipeline.get_by_name("out")
    pipeline.set_state(Gst.State.PLAYING)
    try:
        for number, unit in enumerate(units):
            buffer = Gst.Buffer.new_wrapped(unit)
            buffer.pts = number * _FRAME_NS
            source.emit("push-buffer", buffer)
        source.emit("end-of-stream")
        frames = 0
        for _ in range(len(units) + 1):
            if not sink.emit("try-pull-sample", _WITHIN_S * Gst.SECOND):
                break
            frames += 1
        failed = pipeline.get_bus().pop_filtered(Gst.MessageType.ERROR | Gst.MessageType.WARNING)
        assert failed is None, failed.get_structure().to_string()
        assert sink.get_property("eos"), "the decoder has not come to its end"
        return frames
    finally:
        pipeline.set_state(Gst.State.NULL)
