"""What a program keeps until its end is no work for the garbage collector."""

import gc
import weakref
from typing import Any

from common.garbage import freeze_objects


class Knot:
    """An object that refers to itself, so that only the collector frees it."""

    def __init__(self) -> None:
        self.itself: Any = self


def test_what_exists_is_excluded_from_collections_and_garbage_is_freed_first() -> None:
    kept, garbage = Knot(), weakref.ref(Knot())
    try:
        freeze_objects()
        assert garbage() is None
        assert not any(each is kept for each in gc.get_objects())
    finally:
        gc.unfreeze()
    assert any(each is kept for each in gc.get_objects())
