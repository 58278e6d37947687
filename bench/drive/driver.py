"""A driver who holds all the time: `python -m bench.drive.driver TARGET [--lanes N] [--stay]`.

Says "ready" when the robot moves. After a stop without need they release and hold again; with --stay they
only go on holding. Each line of standard input is answered by one of JSON:

release: releases, and goes on holding only after `again`; the instant, in ns of CLOCK_MONOTONIC.
again: releases and holds; answered when the robot moves.
summary: what was seen since the last one: {"stops": stops without need, "ages_ms": of the newest command, at
    each state of the robot}.
"""

import argparse
import asyncio
import contextlib
import json
import sys
import time
from typing import Any, Final
from unittest.mock import patch

from console.client import (
    AsyncGatewayClient,
    DriveOptions,
    DrivePhase,
    DriveSession,
    Supervision,
    drive_lanes,
    drive_session,
)
from console.client.mapping.driving import DriveCommand, command_request

SPEED_MPS: Final = 0.1
HOLD_EVERY_S: Final = 0.02
READY_WITHIN_S: Final = 15.0
MOVES_WITHIN_S: Final = 2.0
REMEMBERED: Final = 1000
"""Commands whose instant is kept: 20 s."""


class Driver:
    """One session that is held, and what it has seen.

    Args:
        session: open.
        made_ns: when each command was made, by its number.
    """

    def __init__(self, session: DriveSession, made_ns: dict[int, int]) -> None:
        self._session = session
        self._made_ns = made_ns
        self._holding = False
        self._moves = False
        self._stops = 0
        self._ages_ms: list[float] = []

    async def hold(self) -> None:
        """Holds whenever the driver wants to, until cancelled."""
        while True:
            if self._holding:
                self._session.hold(SPEED_MPS)
            await asyncio.sleep(HOLD_EVERY_S)

    async def watch(self) -> None:
        """Counts the stops without need, and begins again after each; until cancelled."""
        async for state in self._session.states():
            if self._moves and state.phase is not DrivePhase.DRIVING:
                self._stops += 1
                await self.begin()

    async def record(self) -> None:
        """Records the age of the newest command at each state, until cancelled."""
        async for state in self._session.states():
            made_ns = self._made_ns.get(state.newest_sequence)
            if made_ns is not None:
                self._ages_ms.append((state.monotonic_ns - made_ns) / 1e6)

    async def begin(self) -> None:
        """Releases and holds, until the robot moves."""
        self._moves = False
        while not self._moves:
            self.release()
            await self._session.ready(READY_WITHIN_S)
            self._holding = True
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(MOVES_WITHIN_S):
                    async for state in self._session.states():
                        if state.phase is DrivePhase.DRIVING:
                            self._moves = True
                            break

    def release(self) -> int:
        """Releases; returns when, in ns."""
        self._holding = self._moves = False
        released_ns = time.monotonic_ns()
        self._session.release()
        return released_ns

    def summary(self) -> dict[str, Any]:
        """Returns what was seen since the last call."""
        self._session.check()
        seen = {"stops": self._stops, "ages_ms": self._ages_ms}
        self._stops, self._ages_ms = 0, []
        return seen

    async def answer(self, word: str) -> Any:
        """Returns the answer to a word."""
        match word:
            case "release":
                return self.release()
            case "again":
                await self.begin()
                return True
            case "summary":
                return self.summary()
        raise ValueError(word)


async def drive(target: str, *, stay: bool) -> None:
    """Drives until standard input ends."""
    made_ns: dict[int, int] = {}

    def noted(command: DriveCommand) -> bytes:
        made_ns[command.sequence] = time.monotonic_ns()
        made_ns.pop(command.sequence - REMEMBERED, None)
        return command_request(command)

    by_eye = DriveOptions(supervision=Supervision.LINE_OF_SIGHT, input_device="bench")
    with patch.object(drive_session, "command_request", noted):
        async with AsyncGatewayClient(target) as client, client.drive(by_eye) as session:
            driver = Driver(session, made_ns)
            jobs = [asyncio.create_task(job) for job in (driver.hold(), driver.record())]
            if not stay:
                jobs.append(asyncio.create_task(driver.watch()))
            await driver.begin()
            print("ready", flush=True)
            while line := await asyncio.to_thread(sys.stdin.readline):
                for job in jobs:
                    if job.done():
                        await job  # Raises why it has ended.
                print(json.dumps(await driver.answer(line.strip())), flush=True)
            for job in jobs:
                job.cancel()
            await asyncio.gather(*jobs, return_exceptions=True)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("target")
    parser.add_argument("--lanes", type=int, default=drive_lanes.LANES)
    parser.add_argument("--stay", action="store_true")
    given = parser.parse_args()
    with patch.object(drive_lanes, "LANES", given.lanes):
        asyncio.run(drive(given.target, stay=given.stay))


if __name__ == "__main__":
    main()
