"""Catalogue of encoder elements, as data: the properties of each family.

GStreamer ranks are useless for choosing an encoder, and property names and units differ between families. So
each family states here the properties for bit rate, GOP length and low latency, and its input caps.
Properties come and go between versions and forks of an element: properties.py sets only those that
`find_property` finds, so an entry may name more than one release has.

Values are written as in gst-launch. No hardware family was tried on hardware: their entries come from the
elements' sources and documentation.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

from preview.state.values import Codec

_BIT_PER_S: Final = 1000


@dataclass(frozen=True, slots=True)
class ElementProperties:
    """Property names and values of a family of elements.

    Args:
        bitrate: properties for the bit rate; each one that exists is set.
        per_kbps: its unit, as the factor from kbit/s.
        gop: properties for the GOP length (longest distance between key frames), in frames.
        fixed: constant properties: low latency, no B-frames, headers with every key frame.
        vbv_ms: property for the size of the rate buffer (VBV) in ms. Empty: none in that unit.
        vbv_options: property with options, of which `vbv-maxrate` and `vbv-bufsize` make the rate buffer.
        controls: V4L2 controls, packed into `extra-controls`: control -> "bitrate", "gop" or a number.
        input_caps: caps of the element's input.
        upload: element that copies frames into the encoder's memory.
        key_frame_signal: action signal that requests a key frame, in place of a GstForceKeyUnit event.
    """

    bitrate: tuple[str, ...] = ("bitrate",)
    per_kbps: int = 1
    gop: tuple[str, ...] = ("key-int-max",)
    fixed: Mapping[str, str] = field(default_factory=dict)
    vbv_ms: str = ""
    vbv_options: str = ""
    controls: Mapping[str, str] = field(default_factory=dict)
    input_caps: str = "video/x-raw,format=NV12"
    upload: str = ""
    key_frame_signal: str = ""


@dataclass(frozen=True, slots=True)
class Encoder:
    """One entry of the catalogue: an element, its codec and its properties."""

    name: str
    family: str
    element: str
    codec: Codec
    hardware: bool
    properties: ElementProperties


def _values(text: str) -> dict[str, str]:
    """Returns properties written as in gst-launch: "name=value name=value"."""
    return dict(pair.split("=", 1) for pair in text.split())


_MPP = ElementProperties(
    # `bps` upstream, `bitrate` in forks; bit/s in both.
    bitrate=("bps", "bitrate"),
    per_kbps=_BIT_PER_S,
    gop=("gop",),
    # max-pending: frames kept in the encoder; the default is 16.
    fixed=_values("header-mode=each-idr rc-mode=cbr max-pending=1"),
)
_V4L2 = ElementProperties(
    # Properties of its own exist from GStreamer 1.29 only; before, everything is a V4L2 control.
    bitrate=(),
    gop=(),
    controls=_values(
        "video_bitrate=bitrate video_bitrate_mode=1 video_gop_size=gop video_b_frames=0"
        " repeat_sequence_header=1"
    ),
)
_VA = ElementProperties(fixed=_values("rate-control=cbr b-frames=0 ref-frames=1"))
_NV = ElementProperties(
    gop=("gop-size",),
    fixed=_values(
        "rc-mode=cbr bframes=0 b-frames=0 zerolatency=true zero-reorder-delay=true rc-lookahead=0"
        " preset=low-latency-hq repeat-sequence-header=true"
    ),
)
_NVV4L2 = ElementProperties(
    per_kbps=_BIT_PER_S,
    gop=("iframeinterval", "idrinterval"),
    fixed=_values("control-rate=1 insert-sps-pps=true num-B-Frames=0 maxperf-enable=true"),
    input_caps="video/x-raw(memory:NVMM),format=NV12",
    upload="nvvidconv",
    key_frame_signal="force-IDR",
)
_QSV = ElementProperties(
    gop=("gop-size",), fixed=_values("rate-control=cbr b-frames=0 low-latency=true idr-interval=0")
)
_MSDK = ElementProperties(
    gop=("gop-size",),
    # The default of b-frames is -1, the driver's choice.
    fixed=_values("rate-control=cbr b-frames=0 low-delay-brc=true async-depth=1"),
)
_X264 = ElementProperties(
    fixed=_values("tune=zerolatency speed-preset=superfast bframes=0 byte-stream=true intra-refresh=false"),
    # The default of 600 ms allows key frames so large that they cost latency.
    vbv_ms="vbv-buf-capacity",
    input_caps="video/x-raw,format={ I420, NV12 }",
)
_X265 = ElementProperties(
    # The element has no VBV property: it is among the options, as is everything that may delay a frame.
    fixed=_values(
        "tune=zerolatency speed-preset=ultrafast option-string=bframes=0:open-gop=0:repeat-headers=1"
    ),
    vbv_options="option-string",
    input_caps="video/x-raw,format=I420",
)


def _hardware(family: str, properties: ElementProperties) -> list[Encoder]:
    """Returns the two entries of a hardware family, whose elements are named alike in all families."""
    return [
        Encoder(f"{family}-{codec.value}", family, f"{family}{codec.value}enc", codec, True, properties)
        for codec in (Codec.H265, Codec.H264)
    ]


_ENTRIES: Final = (
    *_hardware("mpp", _MPP),
    *_hardware("nvv4l2", _NVV4L2),
    *_hardware("v4l2", _V4L2),
    *_hardware("va", _VA),
    Encoder("va-h265-lp", "va", "vah265lpenc", Codec.H265, True, _VA),
    *_hardware("nv", _NV),
    *_hardware("qsv", _QSV),
    *_hardware("msdk", _MSDK),
    Encoder("x264", "x264", "x264enc", Codec.H264, False, _X264),
    Encoder("x265", "x265", "x265enc", Codec.H265, False, _X265),
)

CATALOGUE: Final[Mapping[str, Encoder]] = MappingProxyType({entry.name: entry for entry in _ENTRIES})
"""Every encoder by its short name."""

DEFAULT_ORDER: Final = (
    *(e.name for e in _ENTRIES if e.hardware and e.codec is Codec.H265),
    *(e.name for e in _ENTRIES if e.hardware and e.codec is Codec.H264),
    "x264",
)
"""Hardware H.265, hardware H.264, then x264. x265 costs too much CPU on a robot: only by configuration."""
