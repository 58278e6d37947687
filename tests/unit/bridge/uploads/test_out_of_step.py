"""Robots of a fleet whose uploads wait for the same thing do not all go on in the same instant."""

from collections import Counter
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from datetime import datetime, tzinfo
from types import SimpleNamespace
from typing import Any

import pytest

from bridge.uploads import uploads
from bridge.uploads.queue import LONGEST_PAUSE_S, State
from common.jittered_backoff import JitteredBackoff
from fleet.errors import HubError, HubReason
from tests.support.eventually import eventually
from tests.support.uploading import Robot, running_uploads

TICKS = 3


@dataclass
class Hub:
    """A hub at which no receiver runs; counts what is asked of it."""

    asked: Counter[str] = field(default_factory=Counter)

    async def request(self, subject: str, _payload: bytes, _timeout_s: float, /) -> bytes:
        self.asked[subject] += 1
        raise HubError(HubReason.NO_RESPONDERS, "no receiver")

    def request_many(self, _subject: str, _payload: bytes, _silence_s: float, /) -> AsyncIterator[bytes]:
        raise HubError(HubReason.NO_RESPONDERS, "no receiver")


@dataclass
class Clock:
    """The clock on the wall."""

    hour: int = 21

    def now(self, zone: tzinfo) -> datetime:
        return datetime(2026, 1, 1, self.hour, 30).astimezone(zone)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(uploads, "datetime", clock)
    return clock


async def ticks(running: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The gates are looked at some times more."""
    looked = 0
    closed = running.uploads._closed

    async def counted() -> str:
        nonlocal looked
        looked += 1
        result: str = await closed()
        return result

    async def count() -> int:
        return looked

    monkeypatch.setattr(running.uploads, "_closed", counted)
    await eventually(count, lambda now: now > TICKS, "the gates are looked at")
    monkeypatch.setattr(running.uploads, "_closed", closed)


@pytest.mark.parametrize("waits_s", [0.0, 1e6])
async def test_hours_that_begin_are_spread_over_the_robots(
    clock: Clock, monkeypatch: pytest.MonkeyPatch, waits_s: float
) -> None:
    robot, hub = Robot(), Hub()
    robot.add("one", {"data.bin": b"one"})
    bounds: list[tuple[float, float]] = []

    def chance(*between: float) -> float:
        bounds.append((between[0], between[1]))
        return waits_s

    async with running_uploads(robot, hub, "127.0.0.1:9", (), hours=("22:00-06:00",)) as running:
        await running.uploads.enqueue("one")
        await running.until("one", lambda each: each and each.state is State.PAUSED)
        monkeypatch.setattr(uploads, "random", SimpleNamespace(uniform=chance))
        clock.hour = 22
        await running.until("one", lambda each: each and each.state is not State.PAUSED)
        await ticks(running, monkeypatch)
        assert bounds == [(0.0, uploads.OPENING_SPREAD_S)]
        assert bool(hub.asked) is not bool(waits_s)
        # An operator who asks does not wait for it.
        await running.uploads.enqueue("one")
        await running.until("one", lambda each: each and each.state is State.FAILED)
        assert hub.asked


async def test_without_hours_it_goes_on_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    robot, hub, charging = Robot(), Hub(), [False]
    robot.add("one", {"data.bin": b"one"})
    monkeypatch.setattr(uploads, "OPENING_SPREAD_S", 1e6)
    async with running_uploads(
        robot, hub, "127.0.0.1:9", (), charging=lambda: charging[0], only_while_charging=True
    ) as running:
        await running.uploads.enqueue("one")
        await running.until("one", lambda each: each and each.state is State.PAUSED)
        charging[0] = True
        await running.until("one", lambda each: each and each.state is State.FAILED)


def test_pauses_after_the_same_failures_differ() -> None:
    pauses = [JitteredBackoff(LONGEST_PAUSE_S) for _ in range(20)]
    for longest_s in (1.0, 2.0, 4.0, 8.0):
        found = [each.next_s() for each in pauses]
        assert all(longest_s / 2 <= each <= longest_s for each in found)
        assert len(set(found)) > 1


async def test_uploads_that_were_cut_are_tried_again_out_of_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """The defect: exactly after 1, 2, 4 ... s, all robots at once."""
    robot, hub = Robot(), Hub()
    robot.add("one", {"data.bin": b"one"})
    asked: list[float] = []

    def next_s(backoff: JitteredBackoff) -> float:
        asked.append(backoff.failures)
        return 1e6

    monkeypatch.setattr(JitteredBackoff, "next_s", next_s)
    async with running_uploads(robot, hub, "127.0.0.1:9", ()) as running:
        await running.uploads.enqueue("one")
        await running.until("one", lambda each: each and each.state is State.FAILED)
    assert asked == [0]
