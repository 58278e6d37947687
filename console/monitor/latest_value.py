"""Latest value of a state that one side writes and another side shows."""

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

ValueT = TypeVar("ValueT")


class LatestValue(Generic[ValueT]):
    """Replaces one frozen value by the next, atomically. Thread-safe.

    Args:
        first: the initial value.
        on_change: called after each change, in the thread that made it; must only hand over.
    """

    def __init__(self, first: ValueT, on_change: Callable[[], None]) -> None:
        self._value = first
        self._on_change = on_change
        self._lock = threading.Lock()

    def get(self) -> ValueT:
        """Returns the latest value."""
        return self._value

    def update(self, change: Callable[[ValueT], ValueT]) -> bool:
        """Replaces the value by what `change` makes of it. Returns whether that is another object."""
        with self._lock:
            before, self._value = self._value, change(self._value)
            changed = self._value is not before
        if changed:
            self._on_change()
        return changed
