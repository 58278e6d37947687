"""What the robot's audit log keeps of driving: each time of motion, each stop, and who was refused."""

import asyncio
import itertools
import json
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from console.client import AsyncGatewayClient, DrivePhase, DriveSession, GatewayError, NotAllowed, Refused
from gateway.access.role import Role
from tests.support.driven_robot import BY_EYE, held, in_motion, was_held
from tests.support.eventually import eventually
from tests.support.guarded_program import Guarded, guarded_program
from tests.support.heard import Base
from tests.support.running_drive import listening_base, running_drive
from tests.support.undisturbed import DisturbedError, same_worker, without_stall_async

# Timed: on a machine that is busy with other tests, a late command would end the motion.
pytestmark = [pytest.mark.ros, pytest.mark.timed, pytest.mark.timeout(300)]
SPEED_MPS = 0.1
RELEASED = "released"
"""What ends no motion here, unless a stall does."""


@contextmanager
def guarded(directory: Path) -> Iterator[tuple[Guarded, Base]]:
    with listening_base() as base, running_drive(directory) as drive:
        teleop = {"socket": str(drive.socket), "line_of_sight": True}
        with guarded_program(directory, directory, teleop=teleop) as robot, same_worker(drive):
            yield robot, base


def records(file: Path) -> list[dict[str, Any]]:
    return (
        [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()] if file.exists() else []
    )


def motions(directory: Path) -> list[dict[str, Any]]:
    """The times of motion in a gateway's audit log."""
    kept = records(directory / "credentials/audit.jsonl")
    return [each for each in kept if each["action"] == "Drive" and " m, " in each["request"]]


@pytest.mark.usefixtures("module_ros_domain")
async def test_who_drove_who_stopped_and_who_was_refused(tmp_path: Path) -> None:
    async def attempt(directory: Path) -> None:
        with guarded(directory) as (robot, base):
            await driven_stopped_and_refused(robot, base, directory)

    await without_stall_async(attempt, tmp_path)


async def driven_stopped_and_refused(robot: Guarded, base: Base, directory: Path) -> None:
    (anna, anna_id), (vic, _) = robot.added("anna", Role.OPERATOR), robot.added("vic", Role.VIEWER)
    async with (
        AsyncGatewayClient(robot.target, credentials=anna) as driver,
        AsyncGatewayClient(robot.target, credentials=vic) as viewer,
    ):
        await eventually(lambda: is_enabled(driver), bool, "driving is enabled")
        async with driver.drive(BY_EYE) as session:
            await in_motion(driver, session, base, SPEED_MPS)
            async with held(session, SPEED_MPS):
                stopped = await viewer.stop_robot("a child on the track")
                was_held(session)
            with pytest.raises(NotAllowed):
                await viewer.reset_stop(stopped.stop.stop_id)

            async def reset() -> bool:
                try:
                    await driver.reset_stop(stopped.stop.stop_id)
                except Refused:
                    return False  # The release is on its way.
                return True

            await eventually(reset, bool, "the stop is reset")
            await in_motion(driver, session, base, SPEED_MPS)
            async with held(session, SPEED_MPS):
                await asyncio.to_thread(robot.admin.revoke, anna_id)
                await eventually(lambda: has_ended(session), bool, "the driver's access has ended")
                was_held(session)

        async def recorded() -> list[dict[str, Any]]:
            return motions(directory)

        found = await eventually(recorded, lambda it: len(it) >= 2, "both times of motion")
        if any(each["answer"] == RELEASED for each in found):
            raise DisturbedError("a hold was not renewed in time, while it began")
    first, second = found
    assert {(each["who"], each["role"]) for each in (first, second)} == {("anna", "operator")}
    assert all(each["request"].endswith("by test") for each in (first, second))
    assert "vic" in first["answer"], "stopped by the viewer"
    assert "access" in second["answer"]
    kept = records(directory / "credentials/audit.jsonl")
    # The client sends a stop on two connections.
    stops = [each for each in kept if each["action"] == "StopRobot"]
    assert {(each["who"], each["role"], each["result"]) for each in stops} == {("vic", "viewer", "accepted")}
    assert all("a child on the track" in each["request"] for each in stops)
    refused = records(directory / "credentials/audit-refused.jsonl")
    assert {(each["who"], each["action"]) for each in refused} >= {("vic", "ResetStop")}


@pytest.mark.usefixtures("module_ros_domain")
async def test_each_motion_names_the_device_that_was_held(tmp_path: Path) -> None:
    await without_stall_async(driven_by_several_devices, tmp_path)


async def driven_by_several_devices(directory: Path) -> None:
    devices = ["gamepad", "keyboard", "gamepad"]
    with guarded(directory) as (robot, base):
        anna, _ = robot.added("anna", Role.OPERATOR)
        async with AsyncGatewayClient(robot.target, credentials=anna) as driver:
            await eventually(lambda: is_enabled(driver), bool, "driving is enabled")
            # Its commands name the session's own device while nothing is held.
            async with driver.drive(BY_EYE) as session:
                for device in devices:
                    await in_motion(driver, session, base, SPEED_MPS, input_device=device)
                    session.release()
                    await eventually(lambda: is_armed(session), bool, "the motion has ended")

        async def held_with() -> list[str]:
            """A hold that was not renewed in time, in a stall, makes two motions of one."""
            named = (each["request"].rpartition(" by ")[2] for each in motions(directory))
            return [device for device, _ in itertools.groupby(named)]

        await eventually(held_with, lambda it: it == devices, "each motion with its device")


async def is_enabled(client: AsyncGatewayClient) -> bool:
    return (await client.status()).teleop.enabled


async def is_armed(session: DriveSession) -> bool:
    session.check()
    return session.state is not None and session.state.phase is DrivePhase.ARMED


@pytest.mark.usefixtures("module_ros_domain")
async def test_a_motion_that_a_killed_gateway_left_is_recorded_by_the_next(tmp_path: Path) -> None:
    await without_stall_async(motion_left_by_a_killed_gateway, tmp_path)


async def motion_left_by_a_killed_gateway(directory: Path) -> None:
    first, second = directory / "first", directory / "second"
    for each in (first, second):
        each.mkdir()
    with listening_base() as base, running_drive(directory) as drive:
        teleop = {"socket": str(drive.socket), "line_of_sight": True}
        with guarded_program(first, first, teleop=teleop) as robot, same_worker(drive):
            anna, _ = robot.added("anna", Role.OPERATOR)
            async with AsyncGatewayClient(robot.target, credentials=anna) as driver:
                with suppress(GatewayError):
                    async with driver.drive(BY_EYE) as session:
                        await in_motion(driver, session, base, SPEED_MPS)
                        os.kill(robot.pid, signal.SIGKILL)
                        await eventually(lambda: has_ended(session), bool, "the session has ended")
        assert not motions(first)
        with guarded_program(second, second, teleop=teleop):

            async def recorded() -> list[dict[str, Any]]:
                return motions(second)

            (motion,) = await eventually(recorded, bool, "the time of motion")
    assert motion["answer"].startswith("stopped by anna: the driver was lost")


async def has_ended(session: DriveSession) -> bool:
    session.hold(SPEED_MPS)
    return session.error is not None
