"""Trial of one decoder, in the child process of common.trial.

Decodes a clip, access unit by access unit, as a robot sends them.
"""

import time
from itertools import pairwise
from typing import Any, Final

from common.errors import UserError
from common.gst import GLib, Gst
from common.trial_child import report
from console.receiver import clips

_FIRST_FRAME_TIMEOUT_S: Final = 1.5
"""A driver may have to wake up."""
_NEXT_FRAME_TIMEOUT_S: Final = 0.3
_POLL_NS: Final = 50_000_000
_MOST_HELD: Final = 1
"""Frames that may be inside while more are pushed: each one adds a frame's time to the latency."""
_FRAME_S: Final = 1 / 30


def main(element: str, codec: str) -> None:
    """Tries GStreamer's decoder `element`."""
    # Kept until the end: a pipeline that is dropped while it plays is torn down badly.
    pipeline = build(element, codec)
    report(trial(pipeline, clips.units(codec)))


def build(element: str, codec: str) -> Any:
    """Returns the pipeline of a trial, not yet started.

    Raises:
        UserError: it can't be built.
    """
    try:
        return Gst.parse_launch(
            f"appsrc name=in format=time is-live=true"
            f" caps=video/x-{codec},stream-format=byte-stream,alignment=au,framerate=30/1"
            f" ! {codec}parse ! {element} ! videoconvert"
            " ! video/x-raw,format=I420 ! appsink name=out sync=false"
        )
    except GLib.Error as error:
        raise UserError(error.message) from error


def trial(pipeline: Any, units: list[bytes]) -> str:
    """Returns why this decoder is rejected; empty if it passes."""
    if pipeline.set_state(Gst.State.PLAYING) == Gst.StateChangeReturn.FAILURE:
        return _error(pipeline) or "it can't be started"
    samples, held, error = _decode(pipeline, units)
    if error:
        return error
    if not samples:
        return "it decodes no frame"
    if held > _MOST_HELD:
        return f"it holds {held} frames back"
    if len(samples) < len(units):
        return f"it decoded {len(samples)} frames of {len(units)}"
    return "" if all(_shows_bars(sample) for sample in samples) else "its frames are wrong"


def _decode(pipeline: Any, units: list[bytes]) -> tuple[list[Any], int, str]:
    """Returns the decoded samples, the most frames held before the end of stream, and an error or ""."""
    source, sink, held, error = pipeline.get_by_name("in"), pipeline.get_by_name("out"), 0, ""
    samples: list[Any] = []
    for number, unit in enumerate(units):
        buffer = Gst.Buffer.new_wrapped_bytes(GLib.Bytes.new(unit))
        buffer.pts = buffer.dts = round(number * _FRAME_S * Gst.SECOND)
        source.emit("push-buffer", buffer)
        deadline_s = time.monotonic() + (_NEXT_FRAME_TIMEOUT_S if number else _FIRST_FRAME_TIMEOUT_S)
        while len(samples) <= number and not error and time.monotonic() < deadline_s:
            _pull(sink, samples)
            error = _error(pipeline)
        held = max(held, number + 1 - len(samples))
        if error or held > _MOST_HELD:
            break
    source.emit("end-of-stream")
    while _pull(sink, samples):
        pass
    return samples, held, error


def _pull(sink: Any, samples: list[Any]) -> bool:
    """Appends one more sample if one comes within _POLL_NS."""
    sample = sink.emit("try-pull-sample", _POLL_NS)
    if sample:
        samples.append(sample)
    return sample is not None


def _shows_bars(sample: Any) -> bool:
    """Whether it shows the clip's colour bars: light on the left, dark on the right."""
    shape = sample.get_caps().get_structure(0)
    if (shape.get_value("width"), shape.get_value("height")) != (clips.WIDTH_PX, clips.HEIGHT_PX):
        return False
    row = bytes(sample.get_buffer().extract_dup(clips.WIDTH_PX * (clips.HEIGHT_PX // 4), clips.WIDTH_PX))
    bar = clips.WIDTH_PX // 7
    bars = [sum(row[i * bar + 8 : (i + 1) * bar - 8]) / (bar - 16) for i in range(7)]
    return bars[0] - bars[6] > 100 and all(one > other for one, other in pairwise(bars))


def _error(pipeline: Any) -> str:
    message = pipeline.get_bus().pop_filtered(Gst.MessageType.ERROR)
    return str(message.parse_error()[0].message) if message else ""
