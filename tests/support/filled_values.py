"""Values of sources with something in every field, made from the annotations of their classes."""

from dataclasses import fields, is_dataclass
from enum import Enum
from itertools import count
from types import NoneType
from typing import Any, get_args, get_type_hints


def filled_value(value_type: type[Any], number: int = 1) -> Any:
    """Returns a value whose fields are neither empty nor zero; another number gives other values."""
    numbers = count(number)
    hints = get_type_hints(value_type)
    return value_type(
        **{field.name: _filled(hints[field.name], next(numbers)) for field in fields(value_type)}
    )


def _filled(annotation: Any, number: int) -> Any:
    choices = [choice for choice in get_args(annotation) if choice not in {NoneType, ...}]
    if choices:
        first = _filled(choices[0], number)
        return (first,) if str(annotation).startswith("tuple") else first
    if is_dataclass(annotation) and isinstance(annotation, type):
        return filled_value(annotation, number)
    if issubclass(annotation, Enum):
        return list(annotation)[-1]
    return True if annotation is bool else annotation(number)
