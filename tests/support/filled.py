"""Messages with everything in them."""

import math
from collections.abc import Collection, Iterator, Sequence
from itertools import chain, count, product
from typing import Any, Final, cast

from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.message import Message

_ITEMS: Final = 2
"""Items of each list of a distinctly filled message. Two show that all are kept, in their order."""

_EXTREMES: Final = {
    FieldDescriptor.CPPTYPE_INT32: -(2**31),
    FieldDescriptor.CPPTYPE_INT64: -(2**63),
    FieldDescriptor.CPPTYPE_UINT32: 2**32 - 1,
    FieldDescriptor.CPPTYPE_UINT64: 2**64 - 1,
}
"""The value of each integer type that is furthest from zero; the longer ones do not survive a float."""


def fields_of(message: Message) -> Sequence[FieldDescriptor]:
    """The fields of a message's type, set or not."""
    # The stubs declare two classes of descriptors that share no base; at run time they are one.
    return cast("Sequence[FieldDescriptor]", message.DESCRIPTOR.fields)


def is_alternative(field: FieldDescriptor) -> bool:
    """Whether a field is a member of a oneof."""
    oneof = field.containing_oneof
    # The compiler puts each `optional` field into a oneof of its own, which it names after the field.
    return oneof is not None and oneof.name != f"_{field.name}"


def fill(message: Message) -> None:
    """Every field set, every flag up, every list with one item; of a oneof only the last member remains."""
    for field in fields_of(message):
        if field.message_type:
            fill(getattr(message, field.name).add() if field.is_repeated else getattr(message, field.name))
        elif field.is_repeated:
            getattr(message, field.name).append(_value(field, number=7, text="first"))
        else:
            setattr(message, field.name, _value(field, number=7, text="first"))


def alternatives(message: Descriptor) -> list[tuple[str, ...]]:
    """All ways to choose one member of each oneof of a message and of the messages below it.

    Each way lists the full names of the members. A message without a oneof has one way: the empty one.
    """
    choices: dict[str, list[tuple[str, ...]]] = {}
    for field in message.fields:
        below: list[tuple[str, ...]] = alternatives(field.message_type) if field.message_type else [()]
        if field.containing_oneof and is_alternative(field):
            members = choices.setdefault(f"of {field.containing_oneof.name}", [])
            members += [(field.full_name, *way) for way in below]
        else:
            choices[f"below {field.name}"] = below
    return [tuple(chain.from_iterable(ways)) for ways in product(*choices.values())]


def fill_distinctly(message: Message, members: Collection[str] = ()) -> None:
    """Every field set, to a value that no other field of the whole message has.

    A text is the path of its field. Flags are up and enumerations have their last value; they can't be
    unique, and only `changes` shows where they go.

    Args:
        message: an empty message.
        members: the full names of the members of oneofs to set, as from `alternatives`.
    """
    _fill_distinctly(message, members, count(1), "")


def _fill_distinctly(message: Message, members: Collection[str], numbers: Iterator[int], above: str) -> None:
    for field in fields_of(message):
        path = f"{above}{field.name}"
        if is_alternative(field) and field.full_name not in members:
            continue
        if not field.message_type and field.is_repeated:
            items = [_value(field, number=next(numbers), text=f"{path}[{index}]") for index in range(_ITEMS)]
            getattr(message, field.name).extend(items)
        elif not field.message_type:
            setattr(message, field.name, _value(field, number=next(numbers), text=path))
        elif field.is_repeated:
            for index in range(_ITEMS):
                item = getattr(message, field.name).add()
                _fill_distinctly(item, members, numbers, f"{path}[{index}].")
        else:
            _fill_distinctly(getattr(message, field.name), members, numbers, f"{path}.")


def _value(field: FieldDescriptor, *, number: int, text: str) -> Any:
    if field.enum_type:
        return field.enum_type.values[-1].number
    match field.cpp_type:
        case FieldDescriptor.CPPTYPE_BOOL:
            return True
        case FieldDescriptor.CPPTYPE_STRING:
            return text.encode() if field.type == FieldDescriptor.TYPE_BYTES else text
        case FieldDescriptor.CPPTYPE_FLOAT | FieldDescriptor.CPPTYPE_DOUBLE:
            return number + 0.5  # 32 bits hold it exactly
        case _:
            return number


def changes(message: Message, above: str = "") -> Iterator[str]:
    """Changes one thing of a filled message at a time, in place, and undoes it before the next.

    Every value gets other values: an enumeration all of them, a number zero and an extreme. Every
    submessage, list and optional value is left out once. Members of a oneof are changed, but not left out.

    Yields:
        What is changed: "preview.encoder.codec = 0", "preview.encoder not sent".
    """
    for field, _ in message.ListFields():
        path = f"{above}{field.name}"
        if not field.message_type and field.is_repeated:
            for index in range(len(getattr(message, field.name))):
                yield from _item_changes(message, field, index, f"{path}[{index}]")
        elif not field.message_type:
            yield from _value_changes(message, field, path)
        elif field.is_repeated:
            for index, item in enumerate(getattr(message, field.name)):
                yield from changes(item, f"{path}[{index}].")
        else:
            yield from changes(getattr(message, field.name), f"{path}.")
        if field.is_repeated or (field.has_presence and not is_alternative(field)):
            yield from _omission(message, field, path)


def _value_changes(message: Message, field: FieldDescriptor, path: str) -> Iterator[str]:
    kept = getattr(message, field.name)
    for value in _other_values(field):
        if value != kept:
            setattr(message, field.name, value)
            yield f"{path} = {value!r}"
    setattr(message, field.name, kept)


def _item_changes(message: Message, field: FieldDescriptor, index: int, path: str) -> Iterator[str]:
    items = getattr(message, field.name)
    kept = items[index]
    for value in _other_values(field):
        if value != kept:
            items[index] = value
            yield f"{path} = {value!r}"
    items[index] = kept


def _other_values(field: FieldDescriptor) -> Sequence[Any]:
    if field.enum_type:
        return [value.number for value in field.enum_type.values]
    match field.cpp_type:
        case FieldDescriptor.CPPTYPE_BOOL:
            return [False]
        case FieldDescriptor.CPPTYPE_STRING:
            is_bytes = field.type == FieldDescriptor.TYPE_BYTES
            return [b"other bytes", b""] if is_bytes else ["another text", ""]
        case FieldDescriptor.CPPTYPE_FLOAT | FieldDescriptor.CPPTYPE_DOUBLE:
            return [-0.1, 0.0, math.inf]  # a sign, and digits that 32 bits do not hold exactly
        case _:
            return [_EXTREMES[field.cpp_type], 0]


def _omission(message: Message, field: FieldDescriptor, path: str) -> Iterator[str]:
    kept = type(message)()
    kept.CopyFrom(message)
    message.ClearField(field.name)
    yield f"{path} not sent"
    message.CopyFrom(kept)
