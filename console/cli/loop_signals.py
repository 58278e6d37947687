"""Signals of a program whose one asyncio loop does all its work."""

import asyncio
import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Final

ENDING: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
"""Those that end a program that shows something until it is ended."""


@contextmanager
def handled(actions: Mapping[signal.Signals, Callable[[], object]]) -> Iterator[None]:
    """Handles these signals while the block lasts, except those that the program was started to ignore."""
    loop = asyncio.get_running_loop()
    taken = [number for number in actions if signal.getsignal(number) is not signal.SIG_IGN]
    for number in taken:
        loop.add_signal_handler(number, actions[number])
    try:
        yield
    finally:
        for number in taken:
            loop.remove_signal_handler(number)
