"""A program on the way stands still for a while, or is started again: nothing old moves the robot afterwards.

The driver holds all the time and notices nothing. The base is behind the mux.
"""

import asyncio
import os
import signal
import time
from collections.abc import AsyncIterator, Iterator

import pytest

from console.client import (
    AsyncGatewayClient,
    DriveInhibit,
    DrivePhase,
    DriveSession,
    GatewayError,
    Refused,
    StopLatch,
)
from tests.support.driven_robot import BY_EYE, DrivenRobot, available, driven_robot, held, in_motion, moving
from tests.support.eventually import eventually
from tests.support.promise import keeps_async

pytestmark = [pytest.mark.ros, pytest.mark.timed, pytest.mark.alone]
SPEED_MPS = 0.1
BLOCKED_S = 1.0
BLOCKS_ITS_LOOP = f"import signal, time; signal.signal(signal.SIGUSR1, lambda *_: time.sleep({BLOCKED_S}))"
FROZEN_S = 0.3
TIMES = 3
"""The hundred times are in bench/drive."""
QUIET_S = 0.7
"""Longer than any motion may last after a fault."""
STARTS_WITHIN_S = 30.0


@pytest.fixture(scope="module")
def robot(module_ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[DrivenRobot]:  # noqa: ARG001
    with driven_robot(tmp_path_factory.mktemp("robot"), first=BLOCKS_ITS_LOOP) as robot:
        yield robot


@pytest.fixture
async def client(robot: DrivenRobot) -> AsyncIterator[AsyncGatewayClient]:
    async with available(robot) as client:
        yield client


@pytest.fixture
async def session(client: AsyncGatewayClient) -> AsyncIterator[DriveSession]:
    async with client.drive(BY_EYE) as session:
        yield session


async def moved_s(
    robot: DrivenRobot, client: AsyncGatewayClient, session: DriveSession, numbers: list[signal.Signals]
) -> float:
    """How long the base moves after the gateway got the first signal; the rest follow after FROZEN_S."""
    await in_motion(client, session, robot.base, SPEED_MPS)
    async with held(session, SPEED_MPS):
        with moving(robot.base, robot.drive):
            began_s = time.monotonic()
            for number in numbers:
                os.kill(robot.gateway.process.pid, number)
                await asyncio.sleep(FROZEN_S)
            await asyncio.sleep(BLOCKED_S + QUIET_S - FROZEN_S * len(numbers))
            session.check()
            return robot.base.stopped_after_s(began_s)


async def test_a_gateway_whose_loop_is_blocked_for_a_second_stops_within_280_ms(
    robot: DrivenRobot, client: AsyncGatewayClient, session: DriveSession
) -> None:
    await keeps_async(
        0.28,
        "s of motion after the gateway's loop stood still",
        lambda: moved_s(robot, client, session, [signal.SIGUSR1]),
    )


async def test_frozen_and_thawed_again_and_again_the_gateway_moves_nothing_by_old_commands(
    robot: DrivenRobot, client: AsyncGatewayClient, session: DriveSession
) -> None:
    for _ in range(TIMES):
        await keeps_async(
            0.28,
            "s of motion after the gateway was frozen",
            lambda: moved_s(robot, client, session, [signal.SIGSTOP, signal.SIGCONT]),
        )


async def test_a_drive_program_that_is_started_again_gets_the_lease_and_moves_only_after_a_release(
    robot: DrivenRobot, client: AsyncGatewayClient, session: DriveSession
) -> None:
    """The session goes on: DRIVE_LOST meanwhile, then the stop that the loss has left."""
    await in_motion(client, session, robot.base, SPEED_MPS)
    worker = robot.drive.worker
    async with held(session, SPEED_MPS):
        began_s = time.monotonic()
        worker.kill()
        lost = await reached(session, DriveInhibit.DRIVE_LOST)
        assert lost
        stop = await eventually(lambda: stop_of(session), bool, "the loss is a stop", STARTS_WITHIN_S)
        await asyncio.sleep(QUIET_S)
        assert not robot.base.moves, "the last message is zero"
        assert robot.base.stopped_after_s(began_s) < QUIET_S
    async with AsyncGatewayClient(robot.target) as other:
        await eventually(lambda: is_reset(other, stop), bool, "reset when the release has arrived")
    await asyncio.sleep(QUIET_S)
    assert not robot.base.moves, "a reset moves nothing"
    # The new process has to discover the base first.
    await session.ready(STARTS_WITHIN_S)
    assert session.state is not None
    assert session.state.phase is DrivePhase.ARMED, "the same session has the lease of the new process"
    await in_motion(client, session, robot.base, SPEED_MPS)


async def test_a_stop_while_the_drive_program_is_away_reaches_the_next_one(robot: DrivenRobot) -> None:
    """Nothing masks autonomy meanwhile; it must not have the robot again afterwards."""
    async with available(robot) as client:

        async def inhibits() -> tuple[DriveInhibit, ...]:
            return (await client.status()).teleop.inhibits

        async def stop() -> StopLatch | None:
            return (await client.status()).teleop.stop

        robot.drive.worker.kill()
        await eventually(inhibits, lambda it: DriveInhibit.DRIVE_LOST in it, "the worker is gone")
        with pytest.raises(GatewayError, match="not confirmed the stop"):
            await client.stop_robot("a child")
        found = await eventually(stop, bool, "the next worker has the stop", STARTS_WITHIN_S)
        assert found
        assert found.reason == "a child"
    async with available(robot):  # Not at once: the drive program does not know yet what else commands.
        assert not robot.base.moves


async def reached(session: DriveSession, inhibit: DriveInhibit) -> bool:
    """Waits for a reason not to move."""
    async with asyncio.timeout(STARTS_WITHIN_S):
        async for state in session.states():
            if inhibit in state.inhibits:
                return True
    return False


async def is_reset(client: AsyncGatewayClient, stop_id: int) -> bool:
    try:
        await client.reset_stop(stop_id)
    except Refused:
        return False
    return True


async def stop_of(session: DriveSession) -> int:
    """The number of the stop; 0 without one."""
    session.check()
    return session.state.stop.stop_id if session.state and session.state.stop else 0
