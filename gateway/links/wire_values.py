"""Values of the gateway from messages of the robot's other programs."""

from collections.abc import Mapping
from dataclasses import fields
from enum import Enum
from typing import Any, TypeVar

from google.protobuf.message import Message

ValueT = TypeVar("ValueT")
MemberT = TypeVar("MemberT", bound=Enum)


def same_fields(kind: type[ValueT], message: Message, /, **converted: Any) -> ValueT:
    """Returns the equally named fields of a message, None for an unset optional one, and those converted."""
    unset = {f.name for f in message.DESCRIPTOR.fields if f.has_presence and not message.HasField(f.name)}
    values: dict[str, Any] = {
        each.name: None if each.name in unset else getattr(message, each.name)
        for each in fields(kind)  # type: ignore[arg-type]  # a dataclass
        if each.name not in converted
    }
    return kind(**values, **converted)


def by_number(domain: type[MemberT], message: Any, field: str, prefix: str) -> Mapping[int, MemberT]:
    """Returns the members of an enum by the numbers that a field of a message has for them.

    Args:
        domain: the enum; members that the schema does not have are left out.
        message: descriptor of the message.
        field: of it.
        prefix: what the names of the schema begin with.
    """
    values = message.fields_by_name[field].enum_type.values_by_name
    return {
        values[f"{prefix}_{each.name}"].number: each for each in domain if f"{prefix}_{each.name}" in values
    }


def printable(text: str, longest: int) -> str:
    """Returns the printable characters of a text, at most `longest`."""
    return "".join(letter for letter in text[:longest] if letter.isprintable())
