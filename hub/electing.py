"""Waits for a leader of what the hub is to do something with, while its nodes elect one, or still join."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Final, TypeVar

from common.backoff import Backoff
from fleet.errors import HubError, HubReason

T = TypeVar("T")

ELECTED_WITHIN_S: Final = 15.0
"""A cluster that lost a server has a leader again by then (docs/fleet.md)."""
_ELECTING: Final = (HubReason.NO_RESPONDERS, HubReason.NO_QUORUM, HubReason.TIMEOUT)
"""What the hub answers meanwhile; nothing, while the lost server counts as the leader."""


async def once_elected(work: Callable[[], Awaitable[T]], deadline_s: float | None = None) -> T:
    """Does what may be done twice, and returns its result; while the hub elects a leader for it, tries again.

    Args:
        work: one attempt.
        deadline_s: until when, of the event loop's clock: an attempt that takes longer is ended. None: for
            ELECTED_WITHIN_S.

    Raises:
        HubError: the hub refuses it for another reason, or has elected none by then.
    """
    now_s = asyncio.get_running_loop().time
    deadline_s = now_s() + ELECTED_WITHIN_S if deadline_s is None else deadline_s
    retry, refusal = Backoff(0.1, 1.0), HubError(HubReason.TIMEOUT, "the hub has not done it in time")
    try:
        async with asyncio.timeout_at(deadline_s):
            while now_s() < deadline_s:
                try:
                    return await work()
                except HubError as error:
                    if error.reason not in _ELECTING:
                        raise
                    refusal = error
                await asyncio.sleep(retry.next_s())
    except TimeoutError as late:
        raise refusal from late
    raise refusal
