"""How soon the base has zero after a fault, with real parts. The figures are those of docs/driving.md."""

import asyncio
import os
import signal
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from console.client import AsyncGatewayClient, Credentials, DriveInhibit, NotAllowed
from gateway.access.role import Role
from tests.support.bad_links import Relay
from tests.support.driven_robot import (
    BY_EYE,
    DrivenRobot,
    available,
    driven_base,
    driven_robot,
    free,
    held,
    in_motion,
    moving,
    was_held,
)
from tests.support.eventually import eventually
from tests.support.guarded_program import Guarded, guarded_program
from tests.support.heard import Base
from tests.support.module_program import module_program
from tests.support.promise import keeps_async
from tests.support.running_drive import RunningDrive
from tests.support.shared_robot import shared_robot
from tests.support.undisturbed import DisturbedError

pytestmark = [pytest.mark.ros, pytest.mark.timed, pytest.mark.alone]
ROOT = Path(__file__).parents[4]
SPEED_MPS = 0.1
FROZEN_S = 0.3
HELD_UP_S = 0.26
"""The lanes are full after 0.2 s; after 0.4 s without a state the robot stops by itself."""
QUIET_S = 0.7
"""Longer than any motion may last after a fault."""
WATCHERS = 100
STOPS = 200
"""So that the percentile leaves room for two that something else on this machine holds up."""
THAWS = 3


async def stopped_after_s(
    robot: DrivenRobot,
    target: str,
    fault: Callable[[int], object],
    recovery: Callable[[int], object] = lambda _: None,
) -> float:
    """How long the base moves after a fault, also if the fault ends; both get the driver's process ID.

    The last command before it may be 20 ms older: tests/integration/drive/test_stopping.py begins with that.
    """
    await free(robot)
    with module_program("tests.support.driver_program", target, says="driving") as process:
        with moving(robot.base, robot.drive):
            began_s = time.monotonic()
            fault(process.pid)
            await asyncio.sleep(FROZEN_S)
            recovery(process.pid)
            await asyncio.sleep(QUIET_S)
            assert not robot.base.moves, "the last message is zero"
        return robot.base.stopped_after_s(began_s)


async def test_a_release_stops_within_60_ms(robot: DrivenRobot) -> None:
    async def measure() -> float:
        async with available(robot) as client, client.drive(BY_EYE) as session:
            slowest_s = 0.0
            for _ in range(5):
                await in_motion(client, session, robot.base, SPEED_MPS)
                with moving(robot.base, robot.drive):
                    began_s = time.monotonic()
                    session.release()
                    await asyncio.sleep(QUIET_S)
                slowest_s = max(slowest_s, robot.base.stopped_after_s(began_s))
            return slowest_s

    await keeps_async(0.06, "s of motion after a release", measure)


async def test_a_release_stops_within_60_ms_while_the_robots_states_are_held_up(robot: DrivenRobot) -> None:
    async def measure() -> float:
        async with available(robot):
            with Relay(robot.gateway.port) as relay:
                return await released_after_s(robot, relay)

    await keeps_async(0.06, "s of motion after a release whose lanes were full", measure)


async def released_after_s(robot: DrivenRobot, relay: Relay) -> float:
    """How long the base moves after a release by full lanes, which no state of the robot empties."""
    async with AsyncGatewayClient(f"127.0.0.1:{relay.port}") as client, client.drive(BY_EYE) as session:
        await in_motion(client, session, robot.base, SPEED_MPS)
        with moving(robot.base, robot.drive):
            async with held(session, SPEED_MPS):
                relay.hold_answers()
                await asyncio.sleep(HELD_UP_S)
                was_held(session)
                if not robot.base.moves:
                    raise DisturbedError("the robot has stopped before the release")
                began_s = time.monotonic()
            await asyncio.sleep(QUIET_S)
            relay.pass_answers()
        return robot.base.stopped_after_s(began_s)


async def test_a_killed_client_stops_within_100_ms(robot: DrivenRobot) -> None:
    await keeps_async(
        0.1,
        "s of motion after the client was killed",
        lambda: stopped_after_s(robot, robot.target, lambda pid: os.kill(pid, signal.SIGKILL)),
    )


async def test_a_frozen_client_stops_within_280_ms(robot: DrivenRobot) -> None:
    await keeps_async(
        0.28,
        "s of motion after the client was frozen",
        lambda: stopped_after_s(robot, robot.target, lambda pid: os.kill(pid, signal.SIGSTOP)),
    )


async def test_a_client_that_thaws_moves_nothing_until_its_driver_releases(robot: DrivenRobot) -> None:
    """Its program goes on holding, as the window of a laptop that was suspended with a key down."""
    for _ in range(THAWS):
        await keeps_async(
            0.28,
            "s of motion after the client was frozen for a moment",
            lambda: stopped_after_s(
                robot,
                robot.target,
                lambda pid: os.kill(pid, signal.SIGSTOP),
                lambda pid: os.kill(pid, signal.SIGCONT),
            ),
        )


async def test_lost_lanes_stop_within_280_ms(robot: DrivenRobot) -> None:
    async def measure() -> float:
        with Relay(robot.gateway.port) as relay:
            return await stopped_after_s(robot, f"127.0.0.1:{relay.port}", lambda _: relay.fall_silent())

    await keeps_async(0.28, "s of motion after all lanes fell silent", measure)


@pytest.mark.parametrize(
    ("number", "promised_s"),
    [(signal.SIGKILL, 0.06), (signal.SIGSTOP, 0.28), (signal.SIGTERM, 0.28)],
    ids=["killed", "frozen", "ended"],
)
async def test_a_lost_gateway_stops_in_time(
    ros_domain: int,  # noqa: ARG001  # for its effect
    tmp_path: Path,
    number: signal.Signals,
    promised_s: float,
) -> None:
    """A gateway whose loop is blocked is as silent as a frozen one."""
    attempts = iter(range(99))

    async def measure() -> float:
        directory = tmp_path / str(next(attempts))
        directory.mkdir()
        with driven_robot(directory) as robot:
            process = robot.gateway.process
            try:
                return await stopped_after_s(robot, robot.target, lambda _: os.kill(process.pid, number))
            finally:
                process.send_signal(signal.SIGCONT)

    await keeps_async(promised_s, "s of motion after the gateway was lost", measure)


@pytest.mark.timeout(900)  # two hundred drives, several times on a machine that is busy
async def test_a_stop_takes_50_ms_beside_watchers_and_a_flooder(
    ros_domain: int,  # noqa: ARG001  # for its effect
    tmp_path: Path,
) -> None:
    """The robot is driven each time, by another person than stops it, who may only look."""
    with driven_base(tmp_path) as (base, drive), shared_robot(tmp_path, base, drive) as robot:

        async def measure() -> float:
            siege = robot.target, str(WATCHERS), str(robot.crowd)
            with module_program("tests.support.status_siege", *siege, says="ready"):
                stops = await robot.stops(STOPS)
            return statistics.quantiles([max(it.at_base_s, it.answered_s) for it in stops], n=100)[98]

        await keeps_async(
            0.05, "s at the 99th percentile until the base has zero, and the viewer knows", measure
        )


async def test_a_revoked_driver_stops_within_1_1_s(ros_domain: int, tmp_path: Path) -> None:  # noqa: ARG001
    async def measure() -> float:
        with TemporaryDirectory(dir=tmp_path) as name:
            directory = Path(name)
            with (
                driven_base(directory) as (base, drive),
                guarded_program(
                    directory, directory, teleop={"socket": str(drive.socket), "line_of_sight": True}
                ) as robot,
            ):
                return await revoked_s(robot, base, drive, *robot.added("anna", Role.OPERATOR))

    await keeps_async(1.1, "s of motion after the driver's credential was revoked", measure)


async def revoked_s(
    robot: Guarded, base: Base, drive: RunningDrive, anna: Credentials, credential_id: str
) -> float:
    async with (
        AsyncGatewayClient(robot.target, credentials=robot.own) as admin,
        AsyncGatewayClient(robot.target, credentials=anna) as client,
    ):
        await eventually(lambda: enabled(admin), bool, "driving is enabled")
        async with client.drive(BY_EYE) as session:
            await in_motion(client, session, base, SPEED_MPS)
            with moving(base, drive):
                began_s = time.monotonic()
                async with held(session, SPEED_MPS):
                    await asyncio.to_thread(robot.admin.revoke, credential_id)
                    await asyncio.sleep(QUIET_S + 1.1)
                    was_held(session)
                assert isinstance(session.error, NotAllowed)
                teleop = (await admin.status()).teleop
                assert teleop.stop is not None
                assert not teleop.holder
                assert DriveInhibit.ACCESS_ENDED in teleop.inhibits
                assert not base.moves, "the last message is zero"
            return base.stopped_after_s(began_s)


async def enabled(client: AsyncGatewayClient) -> bool:
    return (await client.status()).teleop.enabled
