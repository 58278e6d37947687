"""Where snapshots come from. Polling is one way; whatever else yields readings can take its place."""

import asyncio
import time
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Protocol

from console.client import (
    CaughtUp,
    Event,
    EventGap,
    EventPosition,
    Outage,
    OverlaySnapshot,
    PreviewChange,
    PreviewProfile,
)

_MS_PER_S = 1000


class Robot(Protocol):
    """What the monitor needs of a client; `console.monitor.renewed.RenewedClient` is one."""

    async def overlay(self) -> OverlaySnapshot:
        """Status, detections and the newest events."""

    def events(
        self, after: EventPosition | None = ...
    ) -> AsyncIterator[Event | EventGap | CaughtUp | Outage]:
        """What happens, each event once."""

    async def enable_preview(
        self, profile: PreviewProfile = ..., *, settle_within_s: float = ...
    ) -> PreviewChange:
        """Turns the preview on, or changes its profile."""

    async def disable_preview(self, *, settle_within_s: float = ...) -> PreviewChange:
        """Turns it off."""

    async def renew(self) -> bool:
        """Takes over a login that was stored meanwhile. Whether there was one."""


@dataclass(frozen=True, slots=True)
class Reading:
    """One snapshot.

    Args:
        snapshot: what the robot said.
        answer_ms: how long it took from the question; None when it came by itself.
    """

    snapshot: OverlaySnapshot
    answer_ms: float | None


class Feed(Protocol):
    """Snapshots of one robot."""

    def readings(self) -> AsyncIterator[Reading]:
        """Yields readings for ever; raises a `GatewayError` when none comes. Calling again begins anew."""

    def hurry(self) -> None:
        """Something has just changed on the robot: the next reading is wanted at once."""


class PollingFeed:
    """Asks again and again.

    Args:
        robot: whom to ask.
        every_s: time from one question to the next. After a slow answer the next question comes at once;
            none is made up for.
    """

    def __init__(self, robot: Robot, every_s: float) -> None:
        self._robot = robot
        self._every_s = every_s
        self._hurry = asyncio.Event()

    async def readings(self) -> AsyncIterator[Reading]:
        """As `Feed.readings`."""
        while True:
            asked_s = time.monotonic()
            self._hurry.clear()
            snapshot = await self._robot.overlay()
            took_s = time.monotonic() - asked_s
            yield Reading(snapshot, took_s * _MS_PER_S)
            await pause(self._every_s - took_s, self._hurry)

    def hurry(self) -> None:
        """As `Feed.hurry`."""
        self._hurry.set()


async def pause(seconds: float, unless: asyncio.Event) -> None:
    """Lets time pass; ends early when the event is set."""
    try:
        async with asyncio.timeout(max(0.0, seconds)):
            await unless.wait()
    except TimeoutError:
        pass
