"""Trial of one encoder, in the child process of common.trial.

Encodes frames of the requested size with the elements of the real pipeline and reports the time to the first
byte.
"""

import os
import time
from typing import Any, Final, NamedTuple

from common.errors import UserError
from common.gst import GLib, Gst
from common.trial_child import report
from preview.encoders import properties
from preview.encoders.catalogue import CATALOGUE, Encoder
from preview.state.values import Target

FRAMES: Final = 10
_ENOUGH: Final = 8
"""Frames that must come out; an encoder may hold back one or two until more arrive."""
_NICE: Final = 5
"""A trial yields the CPU to a running stream."""


class _Seen(NamedTuple):
    """A buffer that passed a pad."""

    at_s: float
    size: int
    is_key_frame: bool


def main(name: str, *figures: str) -> None:
    """Tries the encoder `name`; the figures are width, height, frames/s and kbit/s."""
    os.nice(_NICE)
    width, height, fps, bitrate = (int(figure) for figure in figures)
    # Referenced until the end: a pipeline that is freed while playing is torn down badly.
    pipeline = build(CATALOGUE[name], Target(width, height, fps, bitrate, bitrate))
    raw = _observe(pipeline, "encoder", "sink")
    encoded = _observe(pipeline, "encoder", "src")
    parsed = _observe(pipeline, "out", "sink")
    error = _play(pipeline)
    filled = [buffer for buffer in encoded if buffer.size]
    # Without any output the parser reports an error, too: a consequence, not the cause.
    if error and (filled or error.src is not pipeline.get_by_name("parser")):
        report(error.parse_error()[0].message)
    if not filled:
        report("it produced only empty buffers" if encoded else "it produced no output")
    if len(parsed) < _ENOUGH:
        report(f"only {len(parsed)} of {FRAMES} frames could be parsed")
    if not any(buffer.is_key_frame for buffer in parsed):
        report("its stream has no key frame")
    report(first_byte_ms=(filled[0].at_s - raw[0].at_s) * 1000)


def _observe(pipeline: Any, element: str, pad: str) -> list[_Seen]:
    """Returns a list that each buffer of a pad is added to."""
    seen: list[_Seen] = []

    def probe(_pad: Any, info: Any) -> Any:
        buffer = info.get_buffer()
        key_frame = not buffer.has_flags(Gst.BufferFlags.DELTA_UNIT)
        seen.append(_Seen(time.monotonic(), buffer.get_size(), key_frame))
        return Gst.PadProbeReturn.OK

    pipeline.get_by_name(element).get_static_pad(pad).add_probe(Gst.PadProbeType.BUFFER, probe)
    return seen


def _play(pipeline: Any) -> Any:
    """Plays to the end; returns the first ERROR message, None for none."""
    if pipeline.set_state(Gst.State.PLAYING) == Gst.StateChangeReturn.FAILURE:
        error = pipeline.get_bus().pop_filtered(Gst.MessageType.ERROR)
        return error or report("it can't be started")
    message = pipeline.get_bus().timed_pop_filtered(
        Gst.CLOCK_TIME_NONE, Gst.MessageType.ERROR | Gst.MessageType.EOS
    )
    return message if message.type == Gst.MessageType.ERROR else None


def build(encoder: Encoder, target: Target) -> Any:
    """Returns the pipeline of a trial, not yet started.

    Raises:
        UserError: the pipeline can't be built.
    """
    description = (
        f"videotestsrc num-buffers={FRAMES} pattern=smpte horizontal-speed=16"
        f" ! video/x-raw,width={target.width_px},height={target.height_px},framerate={target.fps}/1"
        f" ! {properties.chain(encoder)} ! fakesink name=out sync=false"
    )
    try:
        pipeline = Gst.parse_launch(description)
    except GLib.Error as error:
        raise UserError(error.message) from error
    pipeline.get_by_name("size").set_property("caps", properties.size_caps(encoder, target))
    kbps = target.bitrate_kbps
    properties.configure(pipeline.get_by_name("encoder"), encoder, kbps, target.fps, highest_kbps=kbps)
    return pipeline
