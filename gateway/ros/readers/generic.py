"""Generic values: fields of any message type, as the configuration names them."""

import math
from typing import Any

from gateway.config import SourceSettings
from gateway.ros.readers.field_path import value_at
from gateway.ros.readers.plain import one_line
from gateway.ros.readers.registry import reads_any_type
from gateway.status.sources import NUMBER, TEXT
from gateway.status.values import Number, Text


@reads_any_type(NUMBER)
def from_number(message: Any, source: SourceSettings) -> Number:
    """Returns the number in the unit of the configuration; an unknown one if the message holds none."""
    raw = value_at(message, source.field or "")
    if raw is None:
        return Number(None)
    # A byte is a `bytes` of length 1 in rclpy.
    number = float(raw[0] if isinstance(raw, bytes) else raw) * source.scale + source.offset
    if not math.isfinite(number):
        return Number(None)
    # Adding zero turns -0.0 into 0.0, which reads as another value.
    return Number(number if source.decimals is None else round(number, source.decimals) + 0.0)


@reads_any_type(TEXT)
def from_text(message: Any, source: SourceSettings) -> Text:
    """Returns the text, or the name of a number, as one line; an unknown one if the message holds none."""
    raw = value_at(message, source.field or "")
    if raw is None:
        return Text(None)
    if not isinstance(raw, str):
        number = int(raw[0] if isinstance(raw, bytes) else raw)
        raw = source.names.get(number, str(number))
    # One character more than is kept shows whether there are more.
    text = one_line(raw, source.max_length + 1).strip()
    return Text(
        text if len(text) <= source.max_length else f"{text[: source.max_length - 1]}\N{HORIZONTAL ELLIPSIS}"
    )
