"""One trial of one decoder, in a process that may crash or hang: `python -m console.receiver.decoder_trial`.

The arguments are GStreamer's element and the codec. It decodes a clip, picture by picture, as they come from
a robot, and prints one line of JSON: why the decoder can't be relied on, or nothing when it can. Whoever
started it sets the deadline.
"""

import json
import os
import sys
import time
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Final

from common.child import end_with_parent
from common.errors import UserError
from common.gst import GLib, Gst
from console.receiver import clips

_ENDS_WITHIN_S: Final = 30
"""More than any caller waits: what is left when the caller was killed between its start and ours."""
_FIRST_WITHIN_S: Final = 1.5
"""A driver may have to wake up."""
_NEXT_WITHIN_S: Final = 0.3
_LOOK_NS: Final = 50_000_000
_MAY_HOLD: Final = 1
"""Pictures that may be inside while more are pushed: each one costs a picture's time of latency."""
_PICTURE_S: Final = 1 / 30


@dataclass
class _Run:
    """What came out of a decoder.

    Args:
        samples: its pictures.
        held: how many were inside at the most before the end was said.
        error: what it complained about; empty when it did not.
    """

    samples: list[Any] = field(default_factory=list)
    held: int = 0
    error: str = ""

    def take(self, out: Any) -> bool:
        """Takes one more picture, if there is one soon."""
        sample = out.emit("try-pull-sample", _LOOK_NS)
        if sample:
            self.samples.append(sample)
        return sample is not None


def main() -> None:
    """Runs one trial."""
    end_with_parent(_ENDS_WITHIN_S)
    element, codec = sys.argv[1:]
    try:
        # Kept until the end: a pipeline that is forgotten while it plays is torn down badly.
        pipeline = build(element, codec)
        reason = trial(pipeline, clips.units(codec))
    except UserError as error:
        reason = str(error)
    sys.stdout.write(json.dumps({"reason": reason}) + "\n")
    sys.stdout.flush()
    # Nothing is stopped: the process ends, and a driver that hangs while it closes has no say any more.
    os._exit(0)


def build(element: str, codec: str) -> Any:
    """The pipeline of a trial, not yet started.

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
    """Why this decoder can't be relied on; empty when it can."""
    if pipeline.set_state(Gst.State.PLAYING) == Gst.StateChangeReturn.FAILURE:
        return _error(pipeline) or "it can't be started"
    run = _decode(pipeline, units)
    if run.error:
        return run.error
    if not run.samples:
        return "it makes no picture"
    if run.held > _MAY_HOLD:
        return f"it holds {run.held} pictures back"
    if len(run.samples) < len(units):
        return f"it made {len(run.samples)} pictures of {len(units)}"
    return "" if all(_is_right(sample) for sample in run.samples) else "its pictures are wrong"


def _decode(pipeline: Any, units: list[bytes]) -> _Run:
    way_in, out, run = pipeline.get_by_name("in"), pipeline.get_by_name("out"), _Run()
    for number, unit in enumerate(units):
        buffer = Gst.Buffer.new_wrapped_bytes(GLib.Bytes.new(unit))
        buffer.pts = buffer.dts = round(number * _PICTURE_S * Gst.SECOND)
        way_in.emit("push-buffer", buffer)
        deadline_s = time.monotonic() + (_NEXT_WITHIN_S if number else _FIRST_WITHIN_S)
        while len(run.samples) <= number and not run.error and time.monotonic() < deadline_s:
            run.take(out)
            run.error = _error(pipeline)
        run.held = max(run.held, number + 1 - len(run.samples))
        if run.error or run.held > _MAY_HOLD:
            break
    way_in.emit("end-of-stream")
    while run.take(out):
        pass
    return run


def _is_right(sample: Any) -> bool:
    """Whether it shows the bars: light on the left, dark on the right."""
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


if __name__ == "__main__":
    main()
