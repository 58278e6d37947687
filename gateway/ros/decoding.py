"""Decodes one serialised message into a value."""

from typing import Any

from rclpy.serialization import deserialize_message

from gateway.config import SourceSettings
from gateway.ros.list_truncation import truncate_list
from gateway.ros.readers import is_header_and_list, reader_for


class Decoder:
    """Decodes the messages of one source.

    Args:
        source: its settings.
        message_type: Python class of the messages.
    """

    def __init__(self, source: SourceSettings, message_type: Any) -> None:
        self._source = source
        self._message_type = message_type
        self._read = reader_for(source)
        self._max_items = max_list_items(source)

    def decode(self, raw: bytes) -> Any:
        """Returns the value; None if the message holds nothing usable. Errors of the deserialiser pass."""
        raw, truncated = truncate_list(raw, self._max_items) if self._max_items else (raw, 0)
        value = self._read(deserialize_message(raw, self._message_type), self._source)
        add_truncated = self._source.spec.add_truncated
        return add_truncated(value, truncated) if truncated and add_truncated and value else value


def max_list_items(source: SourceSettings) -> int | None:
    """Returns the length to truncate lists to; None if the message is not a header and a list."""
    return (source.spec.max_items or source.max_items) if is_header_and_list(source) else None
