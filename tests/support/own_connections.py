"""Connections of this process that are open, whatever has been forgotten."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager

import psutil

from tests.support.eventually import eventually


@contextmanager
def nothing_collected() -> Iterator[None]:
    """Has Python's collector rest: it would close what was forgotten, some time."""
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def own_connections(port: int) -> set[int]:
    """Returns this process's ports that are connected to a port of any machine."""
    found = psutil.Process().net_connections("tcp")
    return {each.laddr.port for each in found if each.raddr and each.raddr.port == port}


async def all_closed(port: int, own: set[int]) -> None:
    """Waits until none of these is there any more."""

    async def left() -> set[int]:
        return own & own_connections(port)

    await eventually(left, lambda now: not now, "the connections are closed")
