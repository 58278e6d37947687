"""The status, told to everybody who watches: looked at once per tick, serialised once for all who are due.

A watcher has no queue. While its answer is on the way it is not due; when it comes back it gets the newest.
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final, NoReturn

from gateway.rpc.answers import REUSE_S
from gateway.rpc.caller import Caller
from gateway.rpc.mapping.status import system_status
from gateway.status.change import change_key
from gateway.status.snapshot import Snapshot
from gateway.status.watch_pacing import TICK_MS, WatchPacing
from omniseer.gateway.v1.robot_gateway_pb2 import WatchSystemStatusResponse

_TICK_S: Final = TICK_MS / 1000
_AT_ONCE: Final = 4
"""Watchers that are answered in one go, which takes some tenths of a millisecond."""
_GROUP_EVERY_S: Final = 0.003
_SPREAD_S: Final = _TICK_S * 0.9
"""The last ones of a tick are answered before the next."""
_NS_PER_S: Final = 1_000_000_000


@dataclass(eq=False, slots=True)
class _Watcher:
    pace: WatchPacing
    wake: asyncio.Future[None] | None = None
    """What it waits for; None while an answer is on the way to it."""


class StatusWatch:
    """Belongs to one event loop; `run` must run for anybody to be told more than the first answer.

    Args:
        take: makes a snapshot of this instant.
        clock: seconds, monotonic; the one that snapshots are dated by.
    """

    def __init__(self, take: Callable[[], Snapshot], clock: Callable[[], float]) -> None:
        self._take = take
        self._clock = clock
        self._watchers: set[_Watcher] = set()
        self._somebody = asyncio.Event()
        self._tick = 0
        self._version = 0
        self._snapshot = take()
        self._change_key = change_key(self._snapshot)
        self._ready: dict[Caller, bytes] = {}
        self.skipped = 0
        """Answers that came due while the one before was still on its way: those readers got newer ones."""

    @property
    def watcher_count(self) -> int:
        """How many watch."""
        return len(self._watchers)

    async def run(self) -> NoReturn:
        """Until cancelled: ticks while somebody watches."""
        due_s = self._clock()
        while True:
            if not self._watchers:
                self._somebody.clear()
                await self._somebody.wait()
            # After a standstill the beat starts anew: ticks are never made up for.
            due_s = max(due_s + _TICK_S, self._clock())
            await asyncio.sleep(due_s - self._clock())
            self._tick += 1
            self._look()
            self._wake_who_is_due()

    async def statuses(self, min_interval_ms: int, caller: Caller) -> AsyncIterator[bytes]:
        """Serialised answers: the first at once, then whenever one is due, until the caller leaves."""
        loop = asyncio.get_running_loop()
        # Whoever has just switched something, and then watches, sees it at once.
        self._look_unless_newer_than(REUSE_S)
        with self._watching(min_interval_ms) as watcher:
            while True:
                yield self._newest(caller)
                # Something may have come due while the answer was on its way.
                if not watcher.pace.due(self._tick, self._version):
                    watcher.wake = loop.create_future()
                    await watcher.wake
                    watcher.wake = None
                watcher.pace.sent(self._tick, self._version)

    @contextmanager
    def _watching(self, min_interval_ms: int) -> Iterator[_Watcher]:
        watcher = _Watcher(WatchPacing(min_interval_ms, self._tick, self._version))
        self._watchers.add(watcher)
        self._somebody.set()
        try:
            yield watcher
        finally:
            self._watchers.discard(watcher)

    def _look(self) -> None:
        self._snapshot = self._take()
        self._ready.clear()
        seen = change_key(self._snapshot)
        if seen != self._change_key:
            self._change_key = seen
            self._version += 1

    def _look_unless_newer_than(self, seconds: float) -> None:
        if self._clock() - self._snapshot.at_s > seconds:
            self._look()

    def _newest(self, caller: Caller) -> bytes:
        # Nobody watched until now, or the loop was held up.
        self._look_unless_newer_than(_TICK_S)
        ready = self._ready.get(caller)
        if ready is None:
            ready = self._ready[caller] = _serialised(self._snapshot, caller)
        return ready

    def _wake_who_is_due(self) -> None:
        """A few at a time, spread over the tick: whoever asks for something else waits for a few only."""
        watchers = [each for each in self._watchers if each.pace.due(self._tick, self._version)]
        due = [each.wake for each in watchers if each.wake is not None]
        self.skipped += len(watchers) - len(due)
        loop = asyncio.get_running_loop()
        groups = [due[begin : begin + _AT_ONCE] for begin in range(0, len(due), _AT_ONCE)]
        for number, group in enumerate(groups):
            loop.call_later(number * min(_GROUP_EVERY_S, _SPREAD_S / len(groups)), _wake, group)


def _wake(waiting: Iterable[asyncio.Future[None]]) -> None:
    for each in waiting:
        if not each.done():
            each.set_result(None)


def _serialised(snapshot: Snapshot, caller: Caller) -> bytes:
    return WatchSystemStatusResponse(
        status=system_status(snapshot, caller), monotonic_ns=int(snapshot.at_s * _NS_PER_S)
    ).SerializeToString()
