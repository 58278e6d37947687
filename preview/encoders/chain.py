"""The piece of pipeline around an encoder: the same in the pipeline and in the trial that precedes it.

So a trial proves what will run. This module needs little, because every trial is a process of its own.
"""

from typing import Any, Final

from common.gst import Gst
from preview.encoders.catalogue import Encoder
from preview.values import Codec, Target

_PARSERS: Final = {Codec.H264: "h264parse", Codec.H265: "h265parse"}
_MEDIA_TYPES: Final = {Codec.H264: "video/x-h264", Codec.H265: "video/x-h265"}


def chain(encoder: Encoder) -> str:
    """From raw video of any form to an elementary stream, one access unit per buffer.

    The elements that are spoken to are named `size`, `encoder` and `parser`.
    """
    return " ! ".join(
        [
            "videoscale ! videoconvert",
            *([encoder.spelling.upload] if encoder.spelling.upload else []),
            "capsfilter name=size",
            f"{encoder.element} name=encoder",
            f"{_PARSERS[encoder.codec]} name=parser config-interval=-1",
            f"{_MEDIA_TYPES[encoder.codec]},stream-format=byte-stream,alignment=au",
        ]
    )


def size_caps(encoder: Encoder, target: Target) -> Any:
    """What the encoder is fed with, for the filter named `size`."""
    return Gst.Caps.from_string(
        f"{encoder.spelling.input_caps},width={target.width_px},height={target.height_px}"
        ",pixel-aspect-ratio=1/1"
    )
