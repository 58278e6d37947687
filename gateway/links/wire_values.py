"""Values of the gateway from messages of the robot's other programs."""

from dataclasses import fields
from typing import Any, TypeVar

from google.protobuf.message import Message

ValueT = TypeVar("ValueT")


def same_fields(kind: type[ValueT], message: Message, /, **converted: Any) -> ValueT:
    """Returns the equally named fields of a message, None for an unset optional one, and those converted."""
    unset = {f.name for f in message.DESCRIPTOR.fields if f.has_presence and not message.HasField(f.name)}
    values: dict[str, Any] = {
        each.name: None if each.name in unset else getattr(message, each.name)
        for each in fields(kind)  # type: ignore[arg-type]  # a dataclass
        if each.name not in converted
    }
    return kind(**values, **converted)
