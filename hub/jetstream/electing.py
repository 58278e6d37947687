"""Waits for a leader of what the hub is to do something with, while its nodes elect one, or still join."""

import asyncio
from collections.abc import Awaitable, Callable, Collection
from typing import Final, TypeVar

from common.backoff import Backoff
from fleet.errors import HubError, HubReason

T = TypeVar("T")

ELECTED_WITHIN_S: Final = 15.0
"""A cluster that lost a server has a leader again by then (docs/fleet.md)."""
_JOINING: Final = (HubReason.NO_QUORUM, HubReason.TIMEOUT)
"""What the API of JetStream answers while nodes join; nothing, for the first 10 s without a leader."""
_ELECTING: Final = (HubReason.NO_RESPONDERS, *_JOINING)
"""What a stream answers meanwhile; nothing, while the lost server counts as the leader."""


async def once_elected(work: Callable[[], Awaitable[T]]) -> T:
    """Does what may be done twice, and returns its result; while the hub elects a leader for it, tries again.

    Args:
        work: one attempt; one that has not ended within ELECTED_WITHIN_S of the first one's begin is ended.

    Raises:
        HubError: the hub refuses it for another reason, or has elected none by then.
    """
    refusal = HubError(HubReason.TIMEOUT, f"the hub has not done it within {ELECTED_WITHIN_S:g} s")

    async def attempt() -> T:
        nonlocal refusal
        try:
            return await work()
        except HubError as error:
            refusal = error
            raise

    deadline_s = asyncio.get_running_loop().time() + ELECTED_WITHIN_S
    try:
        async with asyncio.timeout_at(deadline_s):
            return await _repeated(attempt, _ELECTING, deadline_s)
    except TimeoutError as late:
        raise refusal from late


async def once_joined(work: Callable[[], Awaitable[T]], deadline_s: float) -> T:
    """Does what may be done twice, and returns its result; while nodes of the hub still join, tries again.

    Where the servers run without JetStream, nothing takes a call of its API. That is not waited for: nodes
    with it that still join never answer so.

    Args:
        work: one attempt at calls of the API of JetStream, which ends by itself.
        deadline_s: until when, of the event loop's clock, another attempt is begun. The first one is made in
            any case: who has several things to do may have waited until then for the nodes.

    Raises:
        HubError: of the last attempt.
    """
    return await _repeated(work, _JOINING, deadline_s)


async def _repeated(work: Callable[[], Awaitable[T]], awaited: Collection[HubReason], deadline_s: float) -> T:
    """As `once_joined`, for as long as the hub answers with one of these reasons."""
    now_s, pause = asyncio.get_running_loop().time, Backoff(0.1, 1.0)
    while True:
        try:
            return await work()
        except HubError as error:
            left_s = deadline_s - now_s()
            if error.reason not in awaited or left_s <= 0:
                raise
        await asyncio.sleep(min(pause.next_s(), left_s))
