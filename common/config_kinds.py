"""Finds values of another kind than their keys': true for a number, 1 for true or false. Pure.

pydantic converts them, so that `port: true` would be port 1. And pydantic-settings leaves a section out that
equals its default before anything is checked; True == 1 in Python, so no check of a model would see it.
"""

from collections.abc import Iterator, Mapping
from types import UnionType
from typing import Annotated, Any, Final, Union, get_args, get_origin

from pydantic import BaseModel

from common.config_problems import Problem

_ANY: Final = (Any, object)


def misfits(settings_type: type[BaseModel], values: Mapping[str, Any]) -> Iterator[Problem]:
    """Yields the values of a configuration that their keys do not take, the first one first.

    Args:
        settings_type: the model that they are for.
        values: as YAML or JSON has them; keys as the model names them.
    """
    return _misfits((settings_type,), values, ())


def _misfits(kinds: tuple[Any, ...], value: Any, location: tuple[int | str, ...]) -> Iterator[Problem]:
    kinds = tuple(member for kind in kinds for member in _members(kind))
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _misfits(_kinds_of_keys(kinds), key, (*location, str(key)))
            yield from _misfits(_kinds_behind(kinds, key), inner, (*location, str(key)))
    elif isinstance(value, list):
        for position, inner in enumerate(value):
            yield from _misfits(_kinds_of_items(kinds, position), inner, (*location, position))
    elif expected := _expected(kinds, value):
        shown = str(value).lower() if isinstance(value, bool) else repr(value)
        key = ".".join(map(str, location))
        yield Problem(location, f"key '{key}' is {shown}, expected: {expected}")


def _expected(kinds: tuple[Any, ...], value: Any) -> str:
    """Returns what is expected in a value's place; empty if it may be one of these kinds."""
    if any(kind in _ANY for kind in kinds):
        return ""
    if isinstance(value, bool):
        if bool in kinds or not (int in kinds or float in kinds):
            return ""
        return "a number, 2.5 for example" if float in kinds else "a whole number"
    if isinstance(value, int | float) and bool in kinds and not (int in kinds or float in kinds):
        return "true or false"
    return ""


def _members(kind: Any) -> Iterator[Any]:
    """Yields the members of a union, else the kind itself, without annotations."""
    origin = get_origin(kind)
    if origin is Annotated:
        yield from _members(get_args(kind)[0])
    elif origin in (Union, UnionType):
        for member in get_args(kind):
            yield from _members(member)
    else:
        yield kind


def _kinds_of_keys(kinds: tuple[Any, ...]) -> tuple[Any, ...]:
    """Returns what a mapping takes for keys; nothing for sections, whose keys are names."""
    return tuple(get_args(kind)[0] for kind in kinds if _is_mapping(kind))


def _kinds_behind(kinds: tuple[Any, ...], key: Any) -> tuple[Any, ...]:
    """Returns what may stand behind a key of a section or a mapping; of a union, of any of its members."""
    found: list[Any] = []
    for kind in kinds:
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            found += [
                field.annotation
                for name, field in kind.model_fields.items()
                if key in (name, field.alias, str(name).replace("_", "-"))
            ]
        elif _is_mapping(kind):
            found += get_args(kind)[1:]
    return tuple(found)


def _is_mapping(kind: Any) -> bool:
    origin = get_origin(kind)
    return isinstance(origin, type) and issubclass(origin, Mapping)


def _kinds_of_items(kinds: tuple[Any, ...], position: int) -> tuple[Any, ...]:
    """Returns what may stand at a place of a list; of a union, of any of its members."""
    found: list[Any] = []
    for kind in kinds:
        items = get_args(kind)
        if get_origin(kind) is tuple and items and items[-1] is not Ellipsis:
            found += items[position : position + 1]
        elif get_origin(kind) in (tuple, list, set, frozenset):
            found += items[:1]
    return tuple(found)
