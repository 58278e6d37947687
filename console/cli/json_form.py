"""Results as JSON: the same names, enumerations as their words, secrets left out."""

import dataclasses
import math
from enum import Enum
from typing import Any


def json_form(value: Any) -> Any:
    """What `json.dumps` takes, for a result, a part of one, or a plain value.

    A field that a result hides from its `repr` is a secret, and is left out here as well. JSON has no word
    for NaN and infinity: they become null.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {
            field.name: json_form(getattr(value, field.name))
            for field in dataclasses.fields(value)
            if field.repr
        }
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, tuple):
        return [json_form(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
