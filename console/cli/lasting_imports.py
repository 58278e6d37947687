"""Imports that a program keeps until its end, at less cost: nothing looks for garbage among them."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def lasting_imports() -> Iterator[None]:
    """Keeps what has been imported by the end of the block from the collector of garbage, for good.

    An import makes some hundred thousand objects. Python's collector would walk them again and again while
    there are ever more of them, and once more at the end of the program: a quarter of a short command's time.

    For a program that is about to run a command: whatever else exists by then is kept from it, too.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if enabled:
            gc.enable()
