"""Long lists are cut before they are decoded: decoding holds Python's lock, some 30 us for each item.

Messages that carry a list (detections, diagnostics) are alike: a std_msgs/Header, then the list, nothing
else. On the wire (CDR) the list begins with its length, and a smaller number in its place makes the decoder
stop there: ten thousand detections then cost what a hundred do.
"""

import struct

_ENCODING = 4  # bytes: two for the encoding, two of options; alignment counts from behind them
_STAMP = 8
_LENGTH = 4
# Plain CDR of either version, by the encoding's second byte; even numbers are big-endian.
_PLAIN = frozenset({0, 1, 6, 7})


def cut(raw: bytes, longest: int) -> tuple[bytes, int]:
    """The message with at most `longest` items, and how many were cut off.

    Bytes that are not such a message come back as they are: the decoder says what is wrong with them.
    """
    if len(raw) < _ENCODING or raw[0] != 0 or raw[1] not in _PLAIN:
        return raw, 0
    unsigned = struct.Struct("<I" if raw[1] % 2 else ">I")
    try:
        frame_at = _ENCODING + _STAMP
        (frame_length,) = unsigned.unpack_from(raw, frame_at)
        list_at = _aligned(frame_at + _LENGTH + frame_length)
        (count,) = unsigned.unpack_from(raw, list_at)
    except struct.error:
        return raw, 0
    if count <= longest:
        return raw, 0
    return raw[:list_at] + unsigned.pack(longest) + raw[list_at + _LENGTH :], count - longest


def _aligned(offset: int) -> int:
    return offset + -offset % _LENGTH
