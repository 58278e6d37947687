"""What an access unit contains, by the types of its NAL units. Pure.

ISO/IEC 14496-10 (H.264) 7.4.1, table 7-1, and 23008-2 (H.265) 7.4.2.2, table 7-1; both byte streams are of
annex B.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Final

_START_CODE: Final = b"\0\0\1"
_H264_IDR: Final = 5
_H264_SETS: Final = frozenset({7, 8})
"""Sequence and picture parameter sets."""
_H265_IRAP: Final = range(16, 24)
_H265_SETS: Final = frozenset({32, 33, 34})
"""Video, sequence and picture parameter sets."""


class Codec(Enum):
    """Video coding standard, spelled as in the field `format` of CompressedVideo."""

    H264 = "h264"
    H265 = "h265"


@dataclass(frozen=True, slots=True)
class Content:
    """What an access unit contains.

    Args:
        intra: a picture that needs no earlier one: IDR of H.264, IRAP of H.265.
        parameter_sets: all kinds of them.
    """

    intra: bool
    parameter_sets: bool

    @property
    def decodable(self) -> bool:
        """Whether a decoder can begin here."""
        return self.intra and self.parameter_sets


def content(codec: Codec, unit: bytes) -> Content:
    """Returns what an access unit contains."""
    types = set(_nal_unit_types(codec, unit))
    if codec is Codec.H264:
        return Content(_H264_IDR in types, types >= _H264_SETS)
    return Content(not types.isdisjoint(_H265_IRAP), types >= _H265_SETS)


def _nal_unit_types(codec: Codec, unit: bytes) -> Iterator[int]:
    at = unit.find(_START_CODE)
    while 0 <= at < len(unit) - len(_START_CODE):
        header = unit[at + len(_START_CODE)]
        yield header & 0x1F if codec is Codec.H264 else header >> 1 & 0x3F
        at = unit.find(_START_CODE, at + len(_START_CODE))
