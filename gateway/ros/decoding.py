"""Decodes one serialised message into a value."""

from collections.abc import Callable
from typing import Any

from rclpy.serialization import deserialize_message

from gateway.config import SourceSettings
from gateway.ros.list_truncation import truncate_list
from gateway.ros.readers import is_header_and_list, reader_for


def decoder_of(source: SourceSettings, message_type: Any) -> Callable[[bytes], Any]:
    """Returns the function that makes a value of a message; None of one that holds nothing usable.

    Errors of the deserialiser pass.
    """
    read, max_items, add_truncated = reader_for(source), max_list_items(source), source.spec.add_truncated

    def decode(raw: bytes) -> Any:
        raw, truncated = truncate_list(raw, max_items) if max_items else (raw, 0)
        value = read(deserialize_message(raw, message_type), source)
        return add_truncated(value, truncated) if truncated and add_truncated and value else value

    return decode


def max_list_items(source: SourceSettings) -> int | None:
    """Returns the length to truncate lists to; None if the message is not a header and a list."""
    return (source.spec.max_items or source.max_items) if is_header_and_list(source) else None
