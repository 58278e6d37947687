"""What a message of an image topic shows: its pixels in the form that the preview takes, or why not. Pure.

| message | refused because of |
|---|---|
| ends within a field, names a string without end | MALFORMED |
| an encoding without a form, 32FC1 for example | ENCODING |
| no pixels, more than 8192 in a row or column, more than 32 MiB | SIZE |
| `step` is shorter than the pixels of a row | STEP |
| `data` is shorter than the rows | DATA |
| compressed: no JPEG or PNG, a header that is not whole | COMPRESSED |
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from common.camera_tap import (
    HALF_CHROMA,
    MAX_FRAME_BYTES,
    PACKED,
    frame_bytes,
    row_bytes,
    size_problem,
)
from tap.cdr import Reader
from tap.compressed import measure
from tap.refusal import Reason, RefusedError

IMAGE: Final = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE: Final = "sensor_msgs/msg/CompressedImage"

_LITTLE: Final[Mapping[str, str]] = MappingProxyType(
    {
        "rgb8": "RGB",
        "bgr8": "BGR",
        "rgba8": "RGBA",
        "bgra8": "BGRA",
        "mono8": "GRAY8",
        # What OpenCV calls them (cv_bridge): three channels are blue, green and red there.
        "8UC1": "GRAY8",
        "8UC3": "BGR",
        "8UC4": "BGRA",
        "mono16": "GRAY16_LE",
        "16UC1": "GRAY16_LE",
        # In ROS, yuv422 without more is UYVY.
        "yuv422": "UYVY",
        "uyvy": "UYVY",
        "yuv422_yuy2": "YUY2",
        "yuyv": "YUY2",
        "nv12": "NV12",
        "nv21": "NV21",
        **{f"bayer_{order}8": f"bayer-{order}" for order in ("bggr", "gbrg", "grbg", "rggb")},
    }
)
"""Form by encoding (sensor_msgs/image_encodings.hpp), of little-endian pixels."""
_BIG: Final[Mapping[str, str]] = MappingProxyType({**_LITTLE, "mono16": "GRAY16_BE", "16UC1": "GRAY16_BE"})
ENCODINGS: Final = tuple(_LITTLE)
_LONGEST_QUOTE: Final = 40
_NS_PER_S: Final = 1_000_000_000
_PADDING: Final = bytes(3)


@dataclass(frozen=True, slots=True)
class Frame:
    """What a message shows.

    Args:
        form: of the pixels, see common.camera_tap.
        width: in pixels.
        height: in pixels.
        size: in bytes.
        stamp_ns: `header.stamp`, ns since 1970 where it is of the calendar's clock.
        pieces: the bytes in their order, as views of the message.
    """

    form: str
    width: int
    height: int
    size: int
    stamp_ns: int
    pieces: Sequence[memoryview | bytes]


def read_image(message: bytes) -> Frame:
    """Reads a sensor_msgs/msg/Image.

    Raises:
        RefusedError: it can't be shown.
    """
    reader = Reader(message)
    stamp_ns = _stamp(reader)
    height, width = reader.u32(), reader.u32()
    encoding = reader.string()
    forms = _BIG if reader.u8() else _LITTLE
    step, data = reader.u32(), reader.octets()
    form = forms.get(encoding)
    if form is None:
        raise RefusedError(
            Reason.ENCODING,
            f"has the encoding '{encoding[:_LONGEST_QUOTE]}'; those that can be shown are"
            f" {', '.join(ENCODINGS)}",
        )
    if problem := size_problem(form, width, height):
        raise RefusedError(Reason.SIZE, problem)
    pieces = _half_chroma(form, width, height, step, data) if form in HALF_CHROMA else None
    if pieces is None:
        pieces = _rows(data, height, step, used=width * PACKED[form], needed=row_bytes(form, width))
    return Frame(form, width, height, frame_bytes(form, width, height) or 0, stamp_ns, pieces)


def read_compressed(message: bytes) -> Frame:
    """Reads a sensor_msgs/msg/CompressedImage. Its `format` is not used: publishers write many things there.

    Raises:
        RefusedError: it can't be shown.
    """
    reader = Reader(message)
    stamp_ns = _stamp(reader)
    reader.string()
    picture = reader.octets()
    if len(picture) > MAX_FRAME_BYTES:
        raise RefusedError(Reason.SIZE, f"has {len(picture)} bytes; at most {MAX_FRAME_BYTES} are possible")
    form, width, height = measure(picture)
    # As large as it will be decoded, at the most.
    if problem := size_problem("RGBA", width, height):
        raise RefusedError(Reason.SIZE, problem)
    return Frame(form, width, height, len(picture), stamp_ns, [picture])


READERS: Final[Mapping[str, Callable[[bytes], Frame]]] = MappingProxyType(
    {IMAGE: read_image, COMPRESSED_IMAGE: read_compressed}
)
"""By the topic's type."""


def _stamp(reader: Reader) -> int:
    """Reads a std_msgs/msg/Header."""
    seconds, nanoseconds = reader.i32(), reader.u32()
    reader.string()
    return seconds * _NS_PER_S + nanoseconds


def _half_chroma(
    form: str, width: int, height: int, step: int, data: memoryview
) -> Sequence[memoryview | bytes]:
    """Returns both planes. Some publishers count the chroma into `step`, as "bytes per row of the image"."""
    needed = row_bytes(form, width)
    if step * 2 == width * 3 and len(data) < step * height + step * height // 2:
        step = width
    return _rows(data, height + height // 2, step, used=width, needed=needed)


def _rows(data: memoryview, rows: int, step: int, *, used: int, needed: int) -> Sequence[memoryview | bytes]:
    """Returns rows of `used` bytes, which begin every `step` bytes, as rows of `needed` bytes.

    Raises:
        RefusedError: they are not all there.
    """
    if step < used:
        raise RefusedError(Reason.STEP, f"has rows of {used} bytes, but a step of {step}")
    # Of the last row, only its pixels have to be there.
    if len(data) < step * (rows - 1) + used:
        raise RefusedError(
            Reason.DATA, f"has {len(data)} bytes of data, where {rows} rows of {step} are {step * rows}"
        )
    if step == needed and len(data) >= step * rows:
        return [data[: step * rows]]
    padding = _PADDING[: needed - used]
    pieces: list[memoryview | bytes] = []
    for row in range(0, step * rows, step):
        pieces.append(data[row : row + used])
        if padding:
            pieces.append(padding)
    return pieces
