"""Fields of messages by their path: `cells[2].voltage` is `voltage` of the third item of the list `cells`."""

from dataclasses import dataclass
from functools import cache
from typing import Any


@dataclass(frozen=True, slots=True)
class Step:
    """One name of a path, and the index behind it; None without one."""

    name: str
    index: int | None


# Bounded by the sources of the configuration.
@cache
def steps_of(path: str) -> tuple[Step, ...]:
    """Returns the steps of a path that the configuration has accepted."""
    parts = (part.partition("[") for part in path.split("."))
    return tuple(Step(name, int(index.rstrip("]")) if index else None) for name, _, index in parts)


def value_at(message: Any, path: str) -> Any:
    """Returns the value of a field; None if a list on the way to it is too short."""
    value = message
    for step in steps_of(path):
        value = getattr(value, step.name)
        if step.index is not None:
            if step.index >= len(value):
                return None
            value = value[step.index]
    return value
