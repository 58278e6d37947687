"""The characters that a terminal does not print but obeys, and how they get into every text of a message."""

from collections.abc import Callable
from typing import Final

from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message

CONTROL_CHARACTERS: Final = "".join(
    chr(point)
    for point in (
        *range(0x20),  # C0: escape sequences, line feeds
        *range(0x7F, 0xA0),  # DEL and C1
        0x061C,  # the Arabic letter mark
        *range(0x200E, 0x2010),  # marks of direction
        *range(0x2028, 0x202F),  # line and paragraph separator, embeddings and overrides of direction
        *range(0x2066, 0x206A),  # isolates
        0xFEFF,
        *range(0xE0000, 0xE0080),  # invisible tags
    )
)


def change_texts(message: Message, change: Callable[[str], str]) -> None:
    """Replaces every text that is set, at any depth, by what `change` makes of it."""
    for field, value in message.ListFields():
        if field.message_type:
            for item in value if field.is_repeated else [value]:
                change_texts(item, change)
        elif field.type == FieldDescriptor.TYPE_STRING and field.is_repeated:
            getattr(message, field.name)[:] = [change(item) for item in value]
        elif field.type == FieldDescriptor.TYPE_STRING:
            setattr(message, field.name, change(value))
