"""Messages with everything in them."""

from typing import Any

from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message


def fill(message: Message) -> None:
    """Every field set, every flag up, every list with one item."""
    for field in message.DESCRIPTOR.fields:
        if field.message_type:
            fill(getattr(message, field.name).add() if field.is_repeated else getattr(message, field.name))
        else:
            setattr(message, field.name, value_of(field, first=True))


def value_of(field: FieldDescriptor, *, first: bool) -> Any:
    """One of two values that differ."""
    if field.enum_type:
        return field.enum_type.values[-1 if first else 0].number
    match field.cpp_type:
        case FieldDescriptor.CPPTYPE_BOOL:
            return first
        case FieldDescriptor.CPPTYPE_STRING:
            return "first" if first else "second"
        case FieldDescriptor.CPPTYPE_FLOAT:
            return 1.5 if first else 2.5
        case _:
            return 7 if first else 8
