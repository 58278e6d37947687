"""Tells an encoder element what it shall do, in its own words. Sets only what the element really has."""

from typing import Any, Final

from common.gst import GObject, Gst, GstVideo
from preview.encoders.catalogue import Encoder, KeyFrameBy

_VBV_MS: Final = 150
_LARGEST_FRAME_KBIT: Final = 448
"""What a frame may have so that its PES packet stays below 64 KiB: a longer one has no length, and a
receiver would have to wait for the next frame to know that this one has ended."""


def configure(element: Any, encoder: Encoder, bitrate_kbps: int, gop_frames: int, highest_kbps: int) -> None:
    """Sets everything, before the element runs.

    Args:
        element: the encoder.
        encoder: its entry.
        bitrate_kbps: to begin with.
        gop_frames: the longest distance between key frames.
        highest_kbps: what another profile may raise the bit rate to. Options can't be changed while the
            element runs, and a bit rate above `vbv-maxrate` is cut down to it.
    """
    spelling = encoder.spelling
    for name, value in spelling.fixed.items():
        more = _vbv_options(highest_kbps) if name == spelling.vbv_options else ""
        _set(element, name, value + more)
    set_figures(element, encoder, bitrate_kbps, gop_frames)


def _vbv_options(highest_kbps: int) -> str:
    size_kbit = highest_kbps * vbv_ms(highest_kbps) // 1000
    return f":vbv-maxrate={highest_kbps}:vbv-bufsize={max(1, size_kbit)}"


def set_gop(element: Any, encoder: Encoder, gop_frames: int) -> None:
    """Sets the longest distance between key frames, in frames."""
    for name in encoder.spelling.gop:
        _set(element, name, str(gop_frames))


def set_bitrate(element: Any, encoder: Encoder, bitrate_kbps: int) -> None:
    """Sets the bit rate; while playing only where the catalogue says that it may be."""
    for name in encoder.spelling.bitrate:
        _set(element, name, str(bitrate_kbps * encoder.spelling.unit.value))
    if encoder.spelling.vbv_ms:
        _set(element, encoder.spelling.vbv_ms, str(vbv_ms(bitrate_kbps)))


def set_bitrate_live(element: Any, encoder: Encoder, bitrate_kbps: int, gop_frames: int) -> None:
    """Sets the bit rate and nothing else, while playing."""
    set_bitrate(element, encoder, bitrate_kbps)
    _set_controls(element, encoder, bitrate_kbps, gop_frames)


def set_figures(element: Any, encoder: Encoder, bitrate_kbps: int, gop_frames: int) -> None:
    """Sets bit rate and key frame distance together, as a change of profile does."""
    set_gop(element, encoder, gop_frames)
    set_bitrate(element, encoder, bitrate_kbps)
    _set_controls(element, encoder, bitrate_kbps, gop_frames)


def vbv_ms(bitrate_kbps: int) -> int:
    """The rate buffer in ms: small, and never so large that a key frame outgrows its PES packet."""
    return max(1, min(_VBV_MS, _LARGEST_FRAME_KBIT * 1000 // max(bitrate_kbps, 1)))


def request_key_frame(element: Any, encoder: Encoder, sink_pad: Any) -> None:
    """Asks for a key frame with its headers, at once.

    Args:
        element: the encoder.
        encoder: its entry.
        sink_pad: the listener's pad, from where an event travels up through muxer and parser, so that
            these repeat their headers, too.
    """
    if encoder.spelling.key_frame_by is KeyFrameBy.SIGNAL:
        if GObject.signal_lookup(KeyFrameBy.SIGNAL.value, element):
            element.emit(KeyFrameBy.SIGNAL.value)
        return
    sink_pad.push_event(GstVideo.video_event_new_upstream_force_key_unit(Gst.CLOCK_TIME_NONE, True, 0))


def _set_controls(element: Any, encoder: Encoder, bitrate_kbps: int, gop_frames: int) -> None:
    """V4L2 controls travel as one structure; the element hands them on at once, even while playing."""
    if not encoder.spelling.controls:
        return
    figures = {"bitrate": bitrate_kbps * 1000, "gop": gop_frames}
    values = {
        name: figures[value] if isinstance(value, str) else value
        for name, value in encoder.spelling.controls.items()
    }
    _set(element, "extra-controls", ",".join(["controls", *(f"{n}=(int){v}" for n, v in values.items())]))


def _set(element: Any, name: str, value: str) -> None:
    if element.find_property(name) is not None:
        Gst.util_set_object_arg(element, name, value)
