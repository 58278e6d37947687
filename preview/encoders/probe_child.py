"""Trial of one encoder, in the child process of common.trial.

Encodes frames of the requested size with the elements of the real pipeline and reports the time to the first
byte.
"""

import os
import time
from dataclasses import dataclass
from typing import Any, Final

from common import trial
from common.errors import UserError
from common.gst import GLib, Gst
from preview.encoders import properties
from preview.encoders.catalogue import CATALOGUE, Encoder
from preview.values import Target

FRAMES: Final = 10
_ENOUGH: Final = 8
"""Frames that must come out; an encoder may hold back one or two until more arrive."""
_NICE: Final = 5
"""A trial yields the CPU to a running stream."""


@dataclass(slots=True)
class _Counts:
    """Counts of the pad probes, updated once per frame."""

    first_in_at: float = 0.0
    first_out_at: float = 0.0
    encoded: int = 0
    encoded_bytes: int = 0
    parsed: int = 0
    key_frames: int = 0

    def on_input(self, _pad: Any, _info: Any) -> Any:
        self.first_in_at = time.monotonic()
        return Gst.PadProbeReturn.REMOVE

    def on_encoded(self, _pad: Any, info: Any) -> Any:
        self.encoded += 1
        self.encoded_bytes += info.get_buffer().get_size()
        if self.encoded_bytes:
            self.first_out_at = self.first_out_at or time.monotonic()
        return Gst.PadProbeReturn.OK

    def on_parsed(self, _pad: Any, info: Any) -> Any:
        self.parsed += 1
        self.key_frames += not info.get_buffer().has_flags(Gst.BufferFlags.DELTA_UNIT)
        return Gst.PadProbeReturn.OK

    @property
    def error(self) -> str:
        """What is wrong with the output; empty for nothing."""
        if self.encoded == 0:
            return "it produced no output"
        if self.encoded_bytes == 0:
            return "it produced only empty buffers"
        if self.parsed < _ENOUGH:
            return f"only {self.parsed} of {FRAMES} frames could be parsed"
        return "" if self.key_frames else "its stream has no key frame"


def main(name: str, *figures: str) -> None:
    """Tries the encoder `name`; the figures are width, height, frames/s and kbit/s."""
    os.nice(_NICE)
    width, height, fps, bitrate = (int(figure) for figure in figures)
    # Referenced until the end: a pipeline that is freed while playing is torn down badly.
    pipeline = build(CATALOGUE[name], Target(width, height, fps, bitrate, bitrate))
    counts = _Counts()
    error = encode(pipeline, counts)
    trial.report(error, first_byte_ms=(counts.first_out_at - counts.first_in_at) * 1000)


def encode(pipeline: Any, counts: _Counts) -> str:
    """Encodes FRAMES moving frames and returns what went wrong; empty for nothing."""
    for element, pad, probe in (
        ("encoder", "sink", counts.on_input),
        ("encoder", "src", counts.on_encoded),
        ("out", "sink", counts.on_parsed),
    ):
        pipeline.get_by_name(element).get_static_pad(pad).add_probe(Gst.PadProbeType.BUFFER, probe)
    if pipeline.set_state(Gst.State.PLAYING) == Gst.StateChangeReturn.FAILURE:
        refusal = pipeline.get_bus().pop_filtered(Gst.MessageType.ERROR)
        return str(refusal.parse_error()[0].message) if refusal else "it can't be started"
    message = pipeline.get_bus().timed_pop_filtered(
        Gst.CLOCK_TIME_NONE, Gst.MessageType.ERROR | Gst.MessageType.EOS
    )
    # Without any output the parser reports an error, too: a consequence, not the cause.
    consequence = counts.encoded_bytes == 0 and message.src is pipeline.get_by_name("parser")
    if message.type == Gst.MessageType.ERROR and not consequence:
        return str(message.parse_error()[0].message)
    return counts.error


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
