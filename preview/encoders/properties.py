"""The encoder within a pipeline: its elements, caps and properties.

The trial that proves an encoder and the pipeline that uses it are built from the same pieces. Imports little,
because every trial is a process of its own.
"""

from typing import Any, Final

from common.gst import GObject, Gst, GstVideo
from preview.encoders.catalogue import Encoder
from preview.state.values import Codec, Target

_PARSERS: Final = {Codec.H264: "h264parse", Codec.H265: "h265parse"}
_MEDIA_TYPES: Final = {Codec.H264: "video/x-h264", Codec.H265: "video/x-h265"}
_VBV_MS: Final = 150
_MAX_FRAME_KBIT: Final = 448
"""Keeps a frame's PES packet below 64 KiB. A longer one has no PES_packet_length (16 bits, ISO/IEC 13818-1
2.4.3.7), and a receiver would need the next frame to find its end."""


def chain(encoder: Encoder) -> str:
    """Returns the description from raw video of any form to an elementary stream, one access unit per buffer.

    Its elements `size` (a capsfilter), `encoder` and `parser` are meant to be found by name.
    """
    return " ! ".join(
        [
            "videoscale ! videoconvert",
            *([encoder.properties.upload] if encoder.properties.upload else []),
            "capsfilter name=size",
            f"{encoder.element} name=encoder",
            f"{_PARSERS[encoder.codec]} name=parser config-interval=-1",
            f"{_MEDIA_TYPES[encoder.codec]},stream-format=byte-stream,alignment=au",
        ]
    )


def size_caps(encoder: Encoder, target: Target) -> Any:
    """Returns the caps of the encoder's input, for the capsfilter `size`."""
    return Gst.Caps.from_string(
        f"{encoder.properties.input_caps},width={target.width_px},height={target.height_px}"
        ",pixel-aspect-ratio=1/1"
    )


def configure(element: Any, encoder: Encoder, bitrate_kbps: int, gop_frames: int, highest_kbps: int) -> None:
    """Sets all properties of an element that is not yet started.

    Args:
        element: the encoder element.
        encoder: its entry in the catalogue.
        bitrate_kbps: initial bit rate.
        gop_frames: GOP length in frames.
        highest_kbps: highest bit rate that a profile may switch to. x265's options can't change while it
            runs, and it cuts a bit rate above `vbv-maxrate` down to it.
    """
    names = encoder.properties
    size_kbit = max(1, highest_kbps * vbv_ms(highest_kbps) // 1000)
    for name, value in names.fixed.items():
        vbv = f":vbv-maxrate={highest_kbps}:vbv-bufsize={size_kbit}" if name == names.vbv_options else ""
        _set(element, name, value + vbv)
    set_rates(element, encoder, bitrate_kbps, gop_frames)


def set_rates(element: Any, encoder: Encoder, bitrate_kbps: int, gop_frames: int) -> None:
    """Sets bit rate and GOP length, as a change of profile does."""
    for name in encoder.properties.gop:
        _set(element, name, str(gop_frames))
    set_bitrate(element, encoder, bitrate_kbps, gop_frames)


def set_bitrate(element: Any, encoder: Encoder, bitrate_kbps: int, gop_frames: int) -> None:
    """Sets the bit rate, also while playing.

    Args:
        element: the encoder element.
        encoder: its entry in the catalogue.
        bitrate_kbps: the bit rate.
        gop_frames: GOP length in effect; V4L2 controls are set together.
    """
    names = encoder.properties
    for name in names.bitrate:
        _set(element, name, str(bitrate_kbps * names.per_kbps))
    if names.vbv_ms:
        _set(element, names.vbv_ms, str(vbv_ms(bitrate_kbps)))
    if names.controls:
        rates = {"bitrate": bitrate_kbps * 1000, "gop": gop_frames}
        controls = [f"{name}=(int){rates.get(value, value)}" for name, value in names.controls.items()]
        # One structure; the element hands it to the driver at once, even while playing.
        _set(element, "extra-controls", ",".join(["controls", *controls]))


def vbv_ms(bitrate_kbps: int) -> int:
    """Returns the size of the rate buffer in ms: small, and limits a key frame to one PES packet."""
    return max(1, min(_VBV_MS, _MAX_FRAME_KBIT * 1000 // max(bitrate_kbps, 1)))


def request_key_frame(element: Any, encoder: Encoder, sink_pad: Any) -> None:
    """Requests a key frame with its parameter sets, at once.

    Args:
        element: the encoder element.
        encoder: its entry in the catalogue.
        sink_pad: the one behind the muxer. The event travels upstream from there through muxer and parser,
            which then repeat their tables and headers.
    """
    if signal := encoder.properties.key_frame_signal:
        if GObject.signal_lookup(signal, element):
            element.emit(signal)
        return
    sink_pad.push_event(GstVideo.video_event_new_upstream_force_key_unit(Gst.CLOCK_TIME_NONE, True, 0))


def _set(element: Any, name: str, value: str) -> None:
    """Sets a property that the element has; versions and forks lack some."""
    if element.find_property(name) is not None:
        Gst.util_set_object_arg(element, name, value)
