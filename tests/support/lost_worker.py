"""The stop that the drive program leaves when its worker is lost, as an operator sees it."""

from contextlib import suppress
from typing import Final

from console.client import AsyncGatewayClient, DriveSession, GatewayError, Refused
from tests.support.eventually import eventually

LOST_BY: Final = "robot-drive"
"""Who stops a robot whose worker was lost."""
_READY_WITHIN_S: Final = 15.0
RESET_WITHIN_S: Final = 30.0
"""A new worker takes seconds to start, and then some more to know what else commands the robot."""


async def reset_after_a_loss(client: AsyncGatewayClient) -> None:
    """Resets a stop that the drive program has made itself; one of a caller stays."""

    async def is_reset() -> bool:
        # It may not be known yet what else commands the robot, and a link that loses packets delays calls.
        with suppress(GatewayError):
            stop = (await client.status()).teleop.stop
            if stop is None or stop.by != LOST_BY:
                return True
            await client.reset_stop(stop.stop_id)
        return False

    await eventually(is_reset, bool, "the stop is reset that a lost worker has left", RESET_WITHIN_S)


async def ready_after_a_loss(client: AsyncGatewayClient, session: DriveSession) -> None:
    """Waits until a hold would move the robot, or for a while; resets a stop as `reset_after_a_loss` does.

    Raises:
        GatewayError: the session has ended.
    """
    await reset_after_a_loss(client)
    try:
        await session.ready(_READY_WITHIN_S)
    except Refused:  # The next worker may be lost as well.
        session.check()
