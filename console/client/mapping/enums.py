"""The contract's enumerations. A number without a counterpart reads UNKNOWN, never an error."""

from collections.abc import Mapping
from enum import Enum
from functools import cache
from typing import Any, TypeVar, cast

from google.protobuf.descriptor import EnumDescriptor

MemberT = TypeVar("MemberT", bound=Enum)


def member(members: type[MemberT], wire: EnumDescriptor, number: int) -> MemberT:
    """Returns the member of a number."""
    return cast("MemberT", _by_number(members, wire).get(number, members["UNKNOWN"]))


def number(member: Enum, wire: EnumDescriptor) -> Any:
    """Returns the number of a member."""
    return next((number for number, each in _by_number(type(member), wire).items() if each is member), 0)


@cache
def _by_number(members: type[Enum], wire: EnumDescriptor) -> Mapping[int, Enum]:
    # The contract names its values PREFIX_MEMBER. Its UNSPECIFIED, always 0, is the member UNKNOWN.
    return {
        value.number: each
        for value in wire.values
        for each in members
        if value.name.endswith(f"_{each.name}")
    }
