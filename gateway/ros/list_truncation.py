"""Truncates long lists before deserialisation, which holds Python's lock for some 30 us per item.

It works for messages that consist of a std_msgs/Header and one list (detections, diagnostics). In CDR a list
begins with its length, and the deserialiser reads no further than that: with a smaller length in its place,
ten thousand detections cost what a hundred do.
"""

import struct

# DDSI-RTPS 10 (OMG): a serialised payload begins with two bytes of encapsulation kind and two of options.
# XTypes 7.4: primitives are aligned to their size, counted from behind this header.
_ENCAPSULATION = 4
_STAMP = 8  # builtin_interfaces/Time: int32 sec, uint32 nanosec
_LENGTH = 4
# Second byte of the encapsulation kinds CDR_BE, CDR_LE, CDR2_BE, CDR2_LE; even ones are big-endian.
_PLAIN_CDR = frozenset({0, 1, 6, 7})


def truncate_list(raw: bytes, max_items: int) -> tuple[bytes, int]:
    """Returns the message with at most `max_items` items, and the number of items removed.

    Bytes that are no such message are returned unchanged, for the deserialiser to report.
    """
    if len(raw) < _ENCAPSULATION or raw[0] != 0 or raw[1] not in _PLAIN_CDR:
        return raw, 0
    unsigned = struct.Struct("<I" if raw[1] % 2 else ">I")
    try:
        frame_id_at = _ENCAPSULATION + _STAMP
        (frame_id_length,) = unsigned.unpack_from(raw, frame_id_at)
        list_at = frame_id_at + _LENGTH + frame_id_length
        list_at += -list_at % _LENGTH
        (count,) = unsigned.unpack_from(raw, list_at)
    except struct.error:
        return raw, 0
    if count <= max_items:
        return raw, 0
    return raw[:list_at] + unsigned.pack(max_items) + raw[list_at + _LENGTH :], count - max_items
