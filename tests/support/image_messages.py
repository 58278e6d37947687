"""Serialised image messages, byte by byte: as ROS 2 has them, and as it never would."""

import struct
import zlib

LITTLE, BIG = "<", ">"


class Writer:
    """CDR (RTPS 10.2) in either byte order."""

    def __init__(self, order: str = LITTLE) -> None:
        self._order = order
        self._content = bytearray()

    def number(self, letter: str, value: int) -> "Writer":
        size = struct.calcsize(letter)
        self._content += bytes(-len(self._content) % size)
        self._content += struct.pack(self._order + letter, value)
        return self

    def string(self, text: str) -> "Writer":
        return self.octets(text.encode() + b"\0")

    def octets(self, content: bytes, length: int | None = None) -> "Writer":
        self.number("I", len(content) if length is None else length)
        self._content += content
        return self

    def message(self) -> bytes:
        return (b"\x00\x01" if self._order == LITTLE else b"\x00\x00") + b"\0\0" + bytes(self._content)


def header(order: str = LITTLE, stamp_ns: int = 0, frame_id: str = "camera_link") -> Writer:
    seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
    return Writer(order).number("i", seconds).number("I", nanoseconds).string(frame_id)


def image(
    encoding: str,
    width: int,
    height: int,
    step: int,
    data: bytes,
    *,
    order: str = LITTLE,
    stamp_ns: int = 0,
    frame_id: str = "camera_link",
    big_endian: int = 0,
    length: int | None = None,
) -> bytes:
    """A sensor_msgs/msg/Image; `length` is what it says of its data, unless it is true."""
    written = header(order, stamp_ns, frame_id).number("I", height).number("I", width).string(encoding)
    return written.number("B", big_endian).number("I", step).octets(data, length).message()


def compressed_image(content: bytes, form: str = "jpeg", stamp_ns: int = 0) -> bytes:
    """A sensor_msgs/msg/CompressedImage."""
    return header(stamp_ns=stamp_ns).string(form).octets(content).message()


def jpeg_header(width: int, height: int, before: bytes = b"") -> bytes:
    """The beginning of a JPEG picture, up to its frame header."""
    app0 = b"\xff\xe0" + struct.pack(">H", 16) + b"JFIF\0\x01\x01\0\0\x01\0\x01\0\0"
    sof = b"\xff\xc0" + struct.pack(">HBHHB", 17, 8, height, width, 3) + bytes(9)
    return b"\xff\xd8" + app0 + before + sof


def png(width: int, height: int, colour: tuple[int, int, int] = (255, 0, 0)) -> bytes:
    """A whole PNG picture of one colour."""

    def chunk(name: bytes, content: bytes) -> bytes:
        body = name + content
        return struct.pack(">I", len(content)) + body + struct.pack(">I", zlib.crc32(body))

    rows = (b"\0" + bytes(colour) * width) * height
    ihdr = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    body = chunk(b"IHDR", ihdr) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body
