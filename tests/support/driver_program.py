"""A driver in a process of its own, for tests that kill or freeze it: holds until it is ended.

Run with the gateway's address; prints "driving" when the robot moves.
"""

import asyncio
import sys
from contextlib import AbstractContextManager
from subprocess import Popen
from typing import Final

from console.client import AsyncGatewayClient, DriveOptions, DrivePhase, Supervision, drive_lanes
from tests.support.lost_worker import ready_after_a_loss
from tests.support.module_program import module_program

SPEED_MPS: Final = 0.1
_ATTEMPT: Final = 100
"""Holds without motion after which the driver releases and holds anew, as a busy machine may need."""
_STEADY: Final = 25
"""Holds with motion in a row, from which on the robot drives: a reason may end the very first ones."""


def driver(target: str) -> AbstractContextManager[Popen[str]]:
    """A driver in a process of its own; the robot moves when the block begins."""
    return module_program("tests.support.driver_program", target, says="driving")


async def drive(target: str) -> None:
    """Drives until the process ends."""
    by_eye = DriveOptions(supervision=Supervision.LINE_OF_SIGHT, input_device="test")
    async with AsyncGatewayClient(target) as client, client.drive(by_eye) as session:
        holds, steady, said = 0, 0, False
        while True:
            session.check()
            if not said and holds % _ATTEMPT == 0:
                session.release()
                await ready_after_a_loss(client, session)
            session.hold(SPEED_MPS)
            holds += 1
            moves = session.state is not None and session.state.phase is DrivePhase.DRIVING
            steady = steady + 1 if moves else 0
            if not said and steady >= _STEADY and session.open_lanes == drive_lanes.LANES:
                said = True
                print("driving", flush=True)
            await asyncio.sleep(0.02)


if __name__ == "__main__":
    asyncio.run(drive(sys.argv[1]))
