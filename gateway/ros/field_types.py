"""Whether a message type has the field that a generic source names, and of which kind that is."""

from typing import Any, Final

from common.ros_node import message_class
from gateway.config import SourceSettings
from gateway.ros.readers.field_path import steps_of

_INTEGERS: Final = frozenset(
    {"boolean", "octet", "char", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))}
)
_NUMBERS: Final = _INTEGERS | {"float", "double", "long double"}
"""Names of the basic types of IDL that count as numbers; a boolean is 0 or 1."""


class FieldMissingError(Exception):
    """A message type lacks a field, or it is of another kind; the text says what there is instead."""


def check_field(message_type: Any, source: SourceSettings) -> None:
    """Checks that the message type has the field of a generic source, of the source's kind.

    Raises:
        FieldMissingError: it has not.
        TypeMissingError: the package of a message within the message is not installed.
    """
    if source.field is None:
        return
    kind = _kind_at(message_type, source.type, source.field)
    if source.kind == "number":
        fits, noun = _is_number(kind), "number"
    elif source.names:
        fits, noun = _is_integer(kind), "integer, which 'names' is for"
    else:
        fits, noun = _is_string(kind), "text (an integer is one with 'names')"
    if not fits:
        raise FieldMissingError(f"{source.type}: {source.field} is {_described(kind)}, which is no {noun}")


def _kind_at(message_type: Any, type_name: str, path: str) -> Any:
    """Returns the type of a field as rosidl_parser describes it."""
    parent, kind, done = type_name, None, ""
    for step in steps_of(path):
        if kind is not None:
            if not _is_message(kind):
                raise FieldMissingError(f"{type_name}: {done} is {_described(kind)}, which has no fields")
            parent = _message_name(kind)
            message_type = message_class(parent)
        fields = dict(zip(message_type.get_fields_and_field_types(), message_type.SLOT_TYPES, strict=True))
        if step.name not in fields:
            raise FieldMissingError(f"{parent} has no field '{step.name}'; it has {', '.join(fields)}")
        kind = fields[step.name]
        done = f"{done}.{step.name}".lstrip(".")
        if step.index is not None:
            kind = _item(kind, step.index, f"{type_name}: {done}")
            done = f"{done}[{step.index}]"
        elif hasattr(kind, "value_type"):
            raise FieldMissingError(
                f"{type_name}: {done} is {_described(kind)}: choose an item, {done}[0] for example"
            )
    return kind


def _item(kind: Any, index: int, where: str) -> Any:
    """Returns the type of a list's item."""
    if not hasattr(kind, "value_type"):
        raise FieldMissingError(f"{where} is {_described(kind)}, which has no items")
    # `size` of an array, `maximum_size` of a bounded sequence; others are of any length.
    bound = getattr(kind, "size", getattr(kind, "maximum_size", None))
    if bound is not None and index >= bound:
        raise FieldMissingError(f"{where} has at most {bound} items, of which the last is [{bound - 1}]")
    return kind.value_type


def _is_message(kind: Any) -> bool:
    return hasattr(kind, "namespaced_name")


def _message_name(kind: Any) -> str:
    return "/".join(kind.namespaced_name())


def _is_number(kind: Any) -> bool:
    return getattr(kind, "typename", None) in _NUMBERS


def _is_integer(kind: Any) -> bool:
    return getattr(kind, "typename", None) in _INTEGERS


def _is_string(kind: Any) -> bool:
    return not any(hasattr(kind, name) for name in ("typename", "value_type", "namespaced_name"))


def _described(kind: Any) -> str:
    """Returns a type in words."""
    if hasattr(kind, "value_type"):
        return f"a list of {_name(kind.value_type)}"
    return f"of type {_name(kind)}"


def _name(kind: Any) -> str:
    return _message_name(kind) if _is_message(kind) else str(getattr(kind, "typename", "string"))
