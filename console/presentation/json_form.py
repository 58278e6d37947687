"""Results as JSON: the same names, enumerations by their values, secrets left out."""

import dataclasses
import math
from enum import Enum
from typing import Any


def json_form(value: Any) -> Any:
    """Returns a result, a part of one or a plain value in the types that `json.dumps` takes.

    A field that a result hides from its `repr` is a secret, and is left out here as well. NaN and infinity,
    which JSON does not have (RFC 8259 6), become null; bytes, which are digests, become hexadecimal digits.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {
            field.name: json_form(getattr(value, field.name))
            for field in dataclasses.fields(value)
            if field.repr
        }
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, tuple):
        return [json_form(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
