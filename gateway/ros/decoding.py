"""One message: bytes in, a value out."""

from dataclasses import replace
from typing import Any

from rclpy.serialization import deserialize_message

from gateway.config import SourceSettings
from gateway.ros.cutting import cut
from gateway.ros.readers import is_header_and_list, reader_for
from gateway.ros.readers.registry import Value
from gateway.status.board import SourceKind
from gateway.status.diagnostics import COMPONENTS_KEPT
from gateway.status.values import Detections


class Decoder:
    """Decodes the messages of one source.

    Args:
        source: which reader, and how many items of a list.
        message_type: the message's Python class.
    """

    def __init__(self, source: SourceSettings, message_type: Any) -> None:
        self._source = source
        self._message_type = message_type
        self._read = reader_for(source)
        self._longest = longest_list(source)

    def decode(self, raw: bytes) -> Value | None:
        """The value; None when the message holds nothing that can be used. Raises what the decoder raises."""
        raw, left_out = cut(raw, self._longest) if self._longest else (raw, 0)
        value = self._read(deserialize_message(raw, self._message_type), self._source)
        if left_out and isinstance(value, Detections):
            return replace(value, count=value.count + left_out)
        return value


def longest_list(source: SourceSettings) -> int | None:
    """How many items of a message's list are wanted; None where the message is not a header and a list."""
    if not is_header_and_list(source):
        return None
    return COMPONENTS_KEPT if source.kind is SourceKind.DIAGNOSTICS else source.max_items
