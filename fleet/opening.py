"""Opens a session with the first of several servers that answers, so that a silent one costs a moment.

A server that has no power, or stands still, answers nothing: an attempt at it ends with its time-out
(fleet/nats_client.py). The next one is tried beside it, as RFC 8305 has it for the addresses of a host.
"""

import asyncio
from collections.abc import Callable, Coroutine, Iterable, Sequence
from typing import Any, Final

from common.tasks import cancel
from fleet.errors import HubError, HubReason, UnreachableError
from fleet.session import Session

NEXT_AFTER_S: Final = 1.0
"""A server that has not answered after this time has the next one tried beside it.

More than the 250 ms of RFC 8305, because TLS and authentication are in it, and because the robots of a lost
node come to the other ones all at once: these are slow then, and further attempts would make them slower.
"""
REFUSED_AFTER_S: Final = 2.75
"""Where one server refuses, the others are waited for until this time after the last one of all was tried.

No shorter: a node that has lost its accounts refuses all robots, and the others are slow for the reason
above. No longer: the next attempt begins only after that. Callers, who wait 5 s, learn of the refusal in any
case, also where this program stood still meanwhile (`Hub.connected`).
"""


async def first_to_open(
    servers: Sequence[str], open_one: Callable[[str], Coroutine[Any, Any, Session]]
) -> Session:
    """Returns a session with the server that answers first; those with others are closed.

    Args:
        servers: in the order in which they are tried, each once.
        open_one: opens a session with one of them, within a time of its own.

    Raises:
        HubError: none answers; where one refuses, its refusal, which says more than silence.
    """
    attempts: list[asyncio.Task[Session]] = []
    try:
        first = await _first(servers, open_one, attempts)
        await _abandon(each for each in attempts if each is not first)
    except BaseException:
        # Also that of a task that is cancelled while the others are closed: it gets no session.
        await _abandon(attempts)
        raise
    return first.result()


async def _first(
    servers: Sequence[str],
    open_one: Callable[[str], Coroutine[Any, Any, Session]],
    attempts: list[asyncio.Task[Session]],
) -> asyncio.Task[Session]:
    """Returns the first attempt that succeeds; `attempts` gets every one that is begun."""
    worst: HubError = UnreachableError("no server of the hub is configured")
    left, running = list(servers), set[asyncio.Task[Session]]()
    now_s = asyncio.get_running_loop().time
    tried_s = now_s()
    while left or running:
        if left:
            attempts.append(asyncio.create_task(open_one(left.pop(0))))
            running.add(attempts[-1])
            tried_s = now_s()
        refused = worst.reason is HubReason.REFUSED
        timeout_s: float | None = NEXT_AFTER_S
        if not left:
            timeout_s = max(0.0, tried_s + REFUSED_AFTER_S - now_s()) if refused else None
        ended, running = await asyncio.wait(running, timeout=timeout_s, return_when=asyncio.FIRST_COMPLETED)
        if refused and not left and not ended:
            break
        for attempt in ended:
            try:
                attempt.result()
            except HubError as error:
                worst = worst if worst.reason is HubReason.REFUSED else error
            else:
                return attempt
    raise worst


async def _abandon(attempts: Iterable[asyncio.Task[Session]]) -> None:
    """Ends attempts, and closes the sessions of those that have succeeded."""
    abandoned = list(attempts)
    await cancel(abandoned)
    for attempt in abandoned:
        if not attempt.cancelled() and attempt.exception() is None:
            await attempt.result().close()
