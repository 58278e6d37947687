"""A driver in a process of its own, for tests that kill or freeze it: holds until it is ended.

Run with the gateway's address; prints "driving" when the robot moves.
"""

import asyncio
import sys

from console.client import AsyncGatewayClient, DriveOptions, DrivePhase, Supervision

_SPEED_MPS = 0.1
_ATTEMPT = 100
"""Holds without motion after which the driver releases and holds anew, as a busy machine may need."""


async def drive(target: str) -> None:
    """Drives until the process ends."""
    by_eye = DriveOptions(supervision=Supervision.LINE_OF_SIGHT, input_device="test")
    async with AsyncGatewayClient(target) as client, client.drive(by_eye) as session:
        holds, said = 0, False
        while True:
            session.check()
            if not said and holds % _ATTEMPT == 0:
                session.release()
                await session.ready(within_s=15)
            session.hold(_SPEED_MPS)
            holds += 1
            if not said and session.state and session.state.phase is DrivePhase.DRIVING:
                said = session.open_lanes == 2
                if said:
                    print("driving", flush=True)
            await asyncio.sleep(0.02)


if __name__ == "__main__":
    asyncio.run(drive(sys.argv[1]))
