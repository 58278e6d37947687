"""Calls of a hub that does nothing for a while: nodes that are gone, or stand still, have it elect anew."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Final, TypeVar

from fleet.errors import HubError, HubReason

T = TypeVar("T")

_FINAL: Final = (HubReason.REFUSED, HubReason.TOO_LARGE, HubReason.TOO_MANY, HubReason.INVALID)
"""What the next attempt would be answered with, too."""
_PAUSE_S: Final = 0.1


async def in_the_end(work: Callable[[], Awaitable[T]], within_s: float = 60.0) -> T:
    """Does what may be done twice until the hub does it, and returns the result; fails after `within_s`.

    Args:
        work: one attempt, which ends by itself.
        within_s: how long another attempt is begun.

    Raises:
        HubError: what another attempt would not change.
    """
    loop = asyncio.get_running_loop()
    deadline_s = loop.time() + within_s
    while True:
        try:
            return await work()
        except HubError as error:
            if error.reason in _FINAL:
                raise
            last = error
        assert loop.time() < deadline_s, f"not within {within_s:g} s; last: {last}"
        await asyncio.sleep(_PAUSE_S)
