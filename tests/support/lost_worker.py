"""The stop that the drive program leaves when its worker is lost, as an operator sees it, and its reset."""

from contextlib import suppress
from typing import Final

from console.client import AsyncGatewayClient, DriveSession, GatewayError, Refused
from console.client.results import Teleop
from tests.support.eventually import eventually

LOST_BY: Final = "robot-drive"
"""Who stops a robot whose worker was lost."""
_READY_WITHIN_S: Final = 15.0
RESET_WITHIN_S: Final = 30.0
"""A new worker takes seconds to start, and then some more to know what else commands the robot."""


ANY: Final = ""
"""Whatever stops the robot."""


async def without_stop(client: AsyncGatewayClient, by: str = ANY) -> Teleop | None:
    """Returns driving, as the status has it without a stop; resets one, and returns None then.

    None also where the robot does not say, or does not reset it: it may not be known yet what else commands
    the robot, and a link that loses packets delays calls.

    Args:
        client: of an operator.
        by: whose stops are reset; one of another stays.
    """
    with suppress(GatewayError):
        teleop = (await client.status()).teleop
        if teleop.stop is None or by not in {ANY, teleop.stop.by}:
            return teleop
        await client.reset_stop(teleop.stop.stop_id)
    return None


async def reset_after_a_loss(client: AsyncGatewayClient, by: str = LOST_BY) -> None:
    """Resets a stop that the drive program has made itself, or others as `without_stop`."""
    await eventually(lambda: without_stop(client, by), bool, "the stop is reset", RESET_WITHIN_S)


async def ready_after_a_loss(client: AsyncGatewayClient, session: DriveSession, by: str = LOST_BY) -> None:
    """Waits until a hold would move the robot, or for a while; resets stops as `reset_after_a_loss` does.

    Raises:
        GatewayError: the session has ended.
    """
    await reset_after_a_loss(client, by)
    try:
        await session.ready(_READY_WITHIN_S)
    except Refused:  # The next worker may be lost as well.
        session.check()
