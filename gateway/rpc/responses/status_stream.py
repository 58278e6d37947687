"""The status for all watchers: at most one snapshot per tick, serialised once for all who are due.

A watcher has no queue. While its response is on the way it is not due; when it comes back it gets the newest.
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final, NoReturn

from gateway.rpc.calls.ports import SnapshotSource
from gateway.rpc.calls.recipient import Recipient
from gateway.rpc.mapping.status import detections_message, system_status
from gateway.rpc.responses.response_cache import REUSE_S
from gateway.status.change import change_key
from gateway.status.snapshot import Snapshot
from gateway.status.sources import DETECTIONS
from gateway.status.watch_pacing import TICK_MS, WatchPacing
from omniseer.gateway.v1.robot_gateway_pb2 import WatchSystemStatusResponse

_TICK_S: Final = TICK_MS / 1000
_GROUP_SIZE: Final = 4
"""Watchers that are woken together: serving them takes some tenths of a millisecond."""
_GROUP_SPACING_S: Final = 0.003
_SPREAD_S: Final = _TICK_S * 0.9
"""The last group of a tick is served before the next tick."""
_NS_PER_S: Final = 1_000_000_000


@dataclass(eq=False, slots=True)
class _Watcher:
    pacing: WatchPacing
    with_detections: bool
    wake: asyncio.Future[None] | None = None
    """What it waits for; None while a response is on the way to it."""


class StatusStream:
    """Serves WatchSystemStatus on one event loop; without `run`, watchers get their first response only.

    Args:
        state: where snapshots come from.
        clock: seconds, monotonic; the one that snapshots are dated by.
    """

    def __init__(self, state: SnapshotSource, clock: Callable[[], float]) -> None:
        self._state = state
        self._clock = clock
        self._watchers: set[_Watcher] = set()
        self._watched = asyncio.Event()
        self._tick = 0
        self._counts_for = 0
        """A snapshot taken between two ticks, as the loop had been held up, counts for the later one; for all
        watchers alike."""
        self._versions = {False: 0, True: 0}
        """Of the status without and with detections."""
        self._snapshot = state.snapshot()
        self._change_key = change_key(self._snapshot)
        self._responses: dict[tuple[Recipient, bool], bytes] = {}
        self.skipped = 0
        """Responses that came due while the one before was still on its way: those readers got newer ones."""

    async def run(self) -> NoReturn:
        """Ticks while there are watchers, until cancelled."""
        due_s = self._clock()
        while True:
            if not self._watchers:
                self._watched.clear()
                await self._watched.wait()
            due_s, now_s = due_s + _TICK_S, self._clock()
            if due_s <= now_s:
                # After a stall the beat starts anew: missed ticks are not made up for.
                due_s = now_s + _TICK_S
            await asyncio.sleep(due_s - now_s)
            self._tick += 1
            if any(each.pacing.may_be_due(self._tick) for each in self._watchers):
                self._refresh()
                self._wake_due()

    async def responses(
        self, min_interval_ms: int, recipient: Recipient, *, with_detections: bool = False
    ) -> AsyncIterator[bytes]:
        """Yields serialised responses until the caller leaves: one at once, then whenever one is due."""
        loop = asyncio.get_running_loop()
        # A caller that has just switched the preview, and then watches, sees that in the first response.
        self._refresh_if_older_than(REUSE_S)
        with self._watching(min_interval_ms, with_detections) as watcher:
            while True:
                yield self._response(recipient, with_detections)
                # The next one may have come due while this one was on its way.
                if not self._due(watcher):
                    watcher.wake = loop.create_future()
                    await watcher.wake
                    watcher.wake = None
                if self._refresh_if_older_than(_TICK_S):
                    self._counts_for = self._tick + 1
                watcher.pacing.sent(max(self._tick, self._counts_for), self._versions[with_detections])

    @contextmanager
    def _watching(self, min_interval_ms: int, with_detections: bool) -> Iterator[_Watcher]:
        pacing = WatchPacing(min_interval_ms, self._tick, self._versions[with_detections])
        watcher = _Watcher(pacing, with_detections)
        self._watchers.add(watcher)
        self._watched.set()
        try:
            yield watcher
        finally:
            self._watchers.discard(watcher)

    def _refresh(self) -> None:
        before, self._snapshot = self._snapshot, self._state.snapshot()
        self._responses.clear()
        seen = change_key(self._snapshot)
        changed = seen != self._change_key
        if changed:
            self._change_key = seen
            self._versions[False] += 1
        if changed or _detections_changed(before, self._snapshot):
            self._versions[True] += 1

    def _refresh_if_older_than(self, seconds: float) -> bool:
        """Returns whether it was older."""
        older = self._clock() - self._snapshot.at_s > seconds
        if older:
            self._refresh()
        return older

    def _due(self, watcher: _Watcher) -> bool:
        return watcher.pacing.due(self._tick, self._versions[watcher.with_detections])

    def _response(self, recipient: Recipient, with_detections: bool) -> bytes:
        key = (recipient, with_detections)
        response = self._responses.get(key)
        if response is None:
            response = self._responses[key] = _serialised(self._snapshot, recipient, with_detections)
        return response

    def _wake_due(self) -> None:
        """Wakes groups spread over the tick: any other call waits for one group only."""
        watchers = [each for each in self._watchers if self._due(each)]
        due = [each.wake for each in watchers if each.wake is not None]
        self.skipped += len(watchers) - len(due)
        loop = asyncio.get_running_loop()
        groups = [due[begin : begin + _GROUP_SIZE] for begin in range(0, len(due), _GROUP_SIZE)]
        for number, group in enumerate(groups):
            loop.call_later(number * min(_GROUP_SPACING_S, _SPREAD_S / len(groups)), _wake, group)


def _wake(waiting: Iterable[asyncio.Future[None]]) -> None:
    for each in waiting:
        if not each.done():
            each.set_result(None)


def _detections_changed(before: Snapshot, after: Snapshot) -> bool:
    """By identity: each message makes a new value, and comparing a hundred boxes would cost more."""
    old, new = before[DETECTIONS], after[DETECTIONS]
    return old.value is not new.value or old.freshness.stale != new.freshness.stale


def _serialised(snapshot: Snapshot, recipient: Recipient, with_detections: bool) -> bytes:
    return WatchSystemStatusResponse(
        status=system_status(snapshot, recipient),
        monotonic_ns=int(snapshot.at_s * _NS_PER_S),
        detections=detections_message(snapshot[DETECTIONS]) if with_detections else None,
    ).SerializeToString()
