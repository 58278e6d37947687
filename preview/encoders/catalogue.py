"""The encoders we know, as data: how each family spells what we need of it.

Ranks are useless for choosing and names and units differ everywhere, so each family says here how it is told
its bit rate, how far apart key frames are, that it shall not hold frames back, and what it takes as input.
Properties come and go between versions and forks of an element: whoever sets them asks `find_property`
first (settings.py does), so an entry may name more than one release has.

Values are written as in gst-launch. None of the hardware families could be tried on hardware; what is said
about them is read from their sources and documentation.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType
from typing import Final

from preview.values import Codec


class Unit(Enum):
    """What a bit rate property counts; the value is how many of it make 1 kbit/s."""

    BIT_PER_S = 1000
    KBIT_PER_S = 1


class KeyFrameBy(Enum):
    """How an encoder is asked for a key frame."""

    EVENT = "GstForceKeyUnit"
    SIGNAL = "force-IDR"


@dataclass(frozen=True, slots=True)
class Spelling:
    """How a family of elements spells things.

    Args:
        bitrate: properties for the bit rate; each one that exists is set.
        unit: their unit.
        gop: properties for the longest distance between key frames, in frames.
        fixed: low latency, no B-frames, headers with every key frame.
        vbv_ms: property for the size of the rate buffer in ms. Empty: the family has none in that unit.
        vbv_options: property with options, of which `vbv-maxrate` and `vbv-bufsize` make the rate buffer.
        controls: V4L2 controls, packed into `extra-controls`: control -> "bitrate", "gop" or a number.
        input_caps: what is fed to the element.
        upload: an element that brings frames to where the encoder wants them.
        live_bitrate: whether the bit rate may change while playing.
        key_frame_by: how it is asked for a key frame.
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
    live_bitrate: bool = True
    key_frame_by: KeyFrameBy = KeyFrameBy.EVENT


@dataclass(frozen=True, slots=True)
class Encoder:
    """One entry of the catalogue: an element, what it makes, and how it is spoken to."""

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
    # max-pending: frames kept in the encoder, 16 unless told.
    fixed={"header-mode": "each-idr", "rc-mode": "cbr", "max-pending": "1"},
)
_V4L2 = Spelling(
    # Own properties exist from 1.29 only; before, everything goes through V4L2 controls.
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
    # b-frames is -1 (the driver's choice) unless told.
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
    # 600 ms unless told, which allows key frames so large that they cost latency.
    vbv_ms="vbv-buf-capacity",
    input_caps="video/x-raw,format={ I420, NV12 }",
)
_X265 = Spelling(
    # The element knows no VBV: it comes with the options, and so does all that may delay a frame.
    fixed={
        "tune": "zerolatency",
        "speed-preset": "ultrafast",
        "option-string": "bframes=0:open-gop=0:repeat-headers=1",
    },
    vbv_options="option-string",
    input_caps="video/x-raw,format=I420",
    live_bitrate=True,
)


def _pair(family: str, h265: str, h264: str, spelling: Spelling, *more: tuple[str, str]) -> list[Encoder]:
    """The entries of a hardware family, the one for H.265 first; `more` are (suffix, element) for H.265."""
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
"""Hardware H.265, hardware H.264, then the CPU. x265 is too dear for a robot's CPU: only by configuration."""
