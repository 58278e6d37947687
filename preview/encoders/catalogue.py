"""Catalogue of encoder elements, as data: how each family spells the properties that we need.

GStreamer ranks are useless for choosing an encoder, and property names and units differ between families. So
each family states here the properties for bit rate, GOP length and low latency, and its input caps.
Properties come and go between versions and forks of an element: properties.py sets only those that
`find_property` finds, so an entry may name more than one release has.

Values are written as in gst-launch. No hardware family was tried on hardware: their entries come from the
elements' sources and documentation.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType
from typing import Final

from preview.values import Codec


class Unit(Enum):
    """Unit of a bit rate property; the value is the factor from kbit/s."""

    BIT_PER_S = 1000
    KBIT_PER_S = 1


class KeyFrameBy(Enum):
    """How a key frame is requested."""

    EVENT = "GstForceKeyUnit"
    SIGNAL = "force-IDR"


@dataclass(frozen=True, slots=True)
class Spelling:
    """Property names and values of a family of elements.

    Args:
        bitrate: properties for the bit rate; each one that exists is set.
        unit: unit of `bitrate`.
        gop: properties for the GOP length (longest distance between key frames), in frames.
        fixed: constant properties: low latency, no B-frames, headers with every key frame.
        vbv_ms: property for the size of the rate buffer (VBV) in ms. Empty: none in that unit.
        vbv_options: property with options, of which `vbv-maxrate` and `vbv-bufsize` make the rate buffer.
        controls: V4L2 controls, packed into `extra-controls`: control -> "bitrate", "gop" or a number.
        input_caps: caps of the element's input.
        upload: element that copies frames into the encoder's memory.
        key_frame_by: how a key frame is requested.
    """

    bitrate: tuple[str, ...] = ("bitrate",)
    unit: Unit = Unit.KBIT_PER_S
    gop: tuple[str, ...] = ("key-int-max",)
    fixed: Mapping[str, str] = field(default_factory=dict)
    vbv_ms: str = ""
    vbv_options: str = ""
    controls: Mapping[str, str | int] = field(default_factory=dict)
    input_caps: str = "video/x-raw,format=NV12"
    upload: str = ""
    key_frame_by: KeyFrameBy = KeyFrameBy.EVENT


@dataclass(frozen=True, slots=True)
class Encoder:
    """One entry of the catalogue: an element, its codec and its properties."""

    name: str
    family: str
    element: str
    codec: Codec
    hardware: bool
    spelling: Spelling


_MPP = Spelling(
    # `bps` upstream, `bitrate` in forks; bit/s in both.
    bitrate=("bps", "bitrate"),
    unit=Unit.BIT_PER_S,
    gop=("gop",),
    # max-pending: frames kept in the encoder; the default is 16.
    fixed={"header-mode": "each-idr", "rc-mode": "cbr", "max-pending": "1"},
)
_V4L2 = Spelling(
    # Properties of its own exist from GStreamer 1.29 only; before, everything is a V4L2 control.
    bitrate=(),
    gop=(),
    controls={
        "video_bitrate": "bitrate",
        "video_bitrate_mode": 1,
        "video_gop_size": "gop",
        "video_b_frames": 0,
        "repeat_sequence_header": 1,
    },
)
_VA = Spelling(fixed={"rate-control": "cbr", "b-frames": "0", "ref-frames": "1"})
_NV = Spelling(
    gop=("gop-size",),
    fixed={
        "rc-mode": "cbr",
        "bframes": "0",
        "b-frames": "0",
        "zerolatency": "true",
        "zero-reorder-delay": "true",
        "rc-lookahead": "0",
        "preset": "low-latency-hq",
        "repeat-sequence-header": "true",
    },
)
_NVV4L2 = Spelling(
    unit=Unit.BIT_PER_S,
    gop=("iframeinterval", "idrinterval"),
    fixed={"control-rate": "1", "insert-sps-pps": "true", "num-B-Frames": "0", "maxperf-enable": "true"},
    input_caps="video/x-raw(memory:NVMM),format=NV12",
    upload="nvvidconv",
    key_frame_by=KeyFrameBy.SIGNAL,
)
_QSV = Spelling(
    gop=("gop-size",),
    fixed={"rate-control": "cbr", "b-frames": "0", "low-latency": "true", "idr-interval": "0"},
)
_MSDK = Spelling(
    gop=("gop-size",),
    # The default of b-frames is -1, the driver's choice.
    fixed={"rate-control": "cbr", "b-frames": "0", "low-delay-brc": "true", "async-depth": "1"},
)
_X264 = Spelling(
    fixed={
        "tune": "zerolatency",
        "speed-preset": "superfast",
        "bframes": "0",
        "byte-stream": "true",
        "intra-refresh": "false",
    },
    # The default of 600 ms allows key frames so large that they cost latency.
    vbv_ms="vbv-buf-capacity",
    input_caps="video/x-raw,format={ I420, NV12 }",
)
_X265 = Spelling(
    # The element has no VBV property: it is among the options, as is everything that may delay a frame.
    fixed={
        "tune": "zerolatency",
        "speed-preset": "ultrafast",
        "option-string": "bframes=0:open-gop=0:repeat-headers=1",
    },
    vbv_options="option-string",
    input_caps="video/x-raw,format=I420",
)


def _pair(family: str, h265: str, h264: str, spelling: Spelling, *more: tuple[str, str]) -> list[Encoder]:
    """Returns the entries of a hardware family, H.265 first; `more` are (suffix, element) for H.265."""
    return [
        Encoder(f"{family}-h265", family, h265, Codec.H265, True, spelling),
        *(
            Encoder(f"{family}-h265{suffix}", family, element, Codec.H265, True, spelling)
            for suffix, element in more
        ),
        Encoder(f"{family}-h264", family, h264, Codec.H264, True, spelling),
    ]


_ENTRIES: Final = (
    *_pair("mpp", "mpph265enc", "mpph264enc", _MPP),
    *_pair("nvv4l2", "nvv4l2h265enc", "nvv4l2h264enc", _NVV4L2),
    *_pair("v4l2", "v4l2h265enc", "v4l2h264enc", _V4L2),
    *_pair("va", "vah265enc", "vah264enc", _VA, ("-lp", "vah265lpenc")),
    *_pair("nv", "nvh265enc", "nvh264enc", _NV),
    *_pair("qsv", "qsvh265enc", "qsvh264enc", _QSV),
    *_pair("msdk", "msdkh265enc", "msdkh264enc", _MSDK),
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
