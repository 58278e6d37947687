"""A robot to drive: real gateway and drive program, the mux double behind them, and a base that listens."""

import asyncio
import functools
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ParamSpec

from console.client import (
    AsyncGatewayClient,
    DriveOptions,
    DrivePhase,
    DriveSession,
    Supervision,
)
from drive.config import DriveSettings
from tests.support.driving import BEHIND_THE_MUX
from tests.support.eventually import eventually
from tests.support.gateway_program import GatewayProgram, gateway_program
from tests.support.heard import Base
from tests.support.lost_worker import LOST_BY, RESET_WITHIN_S, ready_after_a_loss, without_stop
from tests.support.ros import simulated_robot
from tests.support.running_drive import RunningDrive, listening_base, running_drive
from tests.support.undisturbed import (
    DisturbedError,
    no_stall,
    same_worker,
    undisturbed,
    undisturbed_async,
)
from tests.support.waiting import wait_until

P = ParamSpec("P")

REST_S = 0.3
"""Longer than any message takes that is on its way."""
_HOLD_EVERY_S = 0.02
_IN_MOTION_WITHIN_S = 45.0
_READY_WITHIN_S = 20.0
_ATTEMPT = 100
"""Holds without motion, each 10 ms or more, after which the driver releases and holds anew."""
BY_EYE = DriveOptions(supervision=Supervision.LINE_OF_SIGHT, input_device="test")


@dataclass
class DrivenRobot:
    """Its parts."""

    gateway: GatewayProgram
    drive: RunningDrive
    base: Base

    @property
    def target(self) -> str:
        return f"127.0.0.1:{self.gateway.port}"

    @property
    def teleop(self) -> Any:
        """Driving, as the status has it."""
        return self.gateway.status().teleop


TELEOP = {"line_of_sight": True, "legacy_clients": True, "allow_insecure": True}


@contextmanager
def driven_base(directory: Path, **settings: Any) -> Iterator[tuple[Base, RunningDrive]]:
    """The drive program, the mux double and a base behind it, in the ROS domain of the environment.

    Args:
        directory: for sockets, state and logs.
        settings: of the drive program.
    """
    watched = DriveSettings().model_dump(mode="json", include={"mux_output", "odometry"})
    with (
        simulated_robot(directory, "--base", "commander=nobody"),
        listening_base(BEHIND_THE_MUX) as base,
        running_drive(directory, **(watched | settings)) as program,
    ):
        yield base, program


@contextmanager
def gateway_for(directory: Path, base: Base, program: RunningDrive, **settings: Any) -> Iterator[DrivenRobot]:
    """A gateway in front of a drive program; ready to be driven when the block begins.

    Args:
        directory: for its configuration and log.
        base: behind the drive program.
        program: the drive program.
        settings: of `gateway_program`; keys of the configuration.
    """
    teleop = {"socket": str(program.socket), **TELEOP, **settings.pop("teleop", {})}
    with gateway_program(directory, sources=[], teleop=teleop, **settings) as gateway:
        robot = DrivenRobot(gateway, program, base)
        wait_until(lambda: robot.teleop.enabled, "driving is enabled")
        yield robot


@contextmanager
def driven_robot(
    directory: Path, *, drive: dict[str, Any] | None = None, **settings: Any
) -> Iterator[DrivenRobot]:
    """Ready to be driven when the block begins; in the ROS domain of the environment."""
    with (
        driven_base(directory, **(drive or {})) as (base, program),
        gateway_for(directory, base, program, **settings) as robot,
    ):
        yield robot


@contextmanager
def moving(base: Base, drive: RunningDrive) -> Iterator[None]:
    """A part of an attempt that begins in motion; see tests.support.undisturbed.

    Args:
        base: that moves.
        drive: by which program.

    Raises:
        DisturbedError: the base is at rest already, or the program's worker was lost.
    """
    with same_worker(drive):
        if not base.moves:
            raise DisturbedError("the base was at rest already")
        yield


def anew_after_a_loss(test: Callable[P, Awaitable[None]]) -> Callable[P, Awaitable[None]]:
    """A test of a robot that is begun anew where the drive program's worker was lost meanwhile."""

    @functools.wraps(test)
    async def begun_anew(*args: P.args, **fixtures: P.kwargs) -> None:
        robot = fixtures["robot"]
        assert isinstance(robot, DrivenRobot)

        async def attempt() -> None:
            await free(robot)
            with same_worker(robot.drive):
                await test(*args, **fixtures)

        await undisturbed_async(attempt)

    return begun_anew


def drives_undisturbed(robot: DrivenRobot, attempt: Callable[[], None]) -> None:
    """Makes attempts with a robot that is free, until no stall has cost the driver the robot."""

    def begun() -> None:
        asyncio.run(free(robot))
        with same_worker(robot.drive), no_stall():
            attempt()

    undisturbed(begun)


async def in_motion(
    client: AsyncGatewayClient,
    session: DriveSession,
    base: Base,
    speed_mps: float,
    *,
    input_device: str = "",
    resets: str = LOST_BY,
) -> None:
    """Holds anew until base and driver have motion; a busy machine may take several attempts.

    A machine that delays the drive program's worker has it replaced, which leaves a stop: that is reset. The
    session goes on.

    Args:
        client: of an operator.
        session: its hold, or another operator's.
        base: what moves.
        speed_mps: straight ahead.
        input_device: what is held; by default the session's own.
        resets: whose stops are reset, as of `without_stop`.
    """
    attempts = 0

    async def moves() -> bool:
        nonlocal attempts
        if attempts % _ATTEMPT == 0:
            session.release()
            await ready_after_a_loss(client, session, resets)
        attempts += 1
        session.hold(speed_mps, input_device=input_device)
        return base.moves and session.state is not None and session.state.phase is DrivePhase.DRIVING

    await eventually(moves, bool, "the base moves, and the driver knows", _IN_MOTION_WITHIN_S)


@asynccontextmanager
async def available(robot: DrivenRobot) -> AsyncIterator[AsyncGatewayClient]:
    """A client of a robot that is not stopped."""
    async with AsyncGatewayClient(robot.target) as client:
        await make_available(client)
        yield client


async def make_available(client: AsyncGatewayClient) -> None:
    """Waits until driving is enabled and the robot is free, and resets what stops it."""

    async def is_free() -> bool:
        teleop = await without_stop(client)
        # The phase is the drive program's word: the gateway knows of the end of a session before it does.
        return bool(teleop and teleop.phase is DrivePhase.AVAILABLE and teleop.enabled and not teleop.holder)

    await eventually(is_free, bool, "the robot is free", RESET_WITHIN_S)


async def free(robot: DrivenRobot) -> None:
    """Waits until the robot is free, and resets what stops it."""
    async with available(robot):
        pass


async def may_be_driven(client: AsyncGatewayClient) -> None:
    """Waits until a hold would move the robot, for which its drive program has to discover the base.

    A single command is accepted before, and comes to its end without motion.
    """
    async with client.drive(BY_EYE) as session:
        await session.ready(_READY_WITHIN_S)


@asynccontextmanager
async def held(session: DriveSession, speed_mps: float) -> AsyncIterator[None]:
    """Holds all the time while the block lasts, as a person who notices nothing; at its end it releases."""

    async def hold() -> None:
        while True:
            session.hold(speed_mps)
            await asyncio.sleep(_HOLD_EVERY_S)

    holding = asyncio.create_task(hold())
    try:
        yield
    finally:
        holding.cancel()
        session.release()


def was_held(session: DriveSession) -> None:
    """The end of a part of an attempt whose holds have to be one.

    Raises:
        DisturbedError: one was not renewed in time, which is a release.
    """
    if session.lapsed:
        raise DisturbedError("the hold was not renewed in time, which is a release")


def network_settings(port: int) -> dict[str, Any]:
    """Returns settings of `driven_robot` for a gateway that all networks of this machine reach."""
    return {"port": port, "grpc": {"host": "0.0.0.0", "port": port}, "security": {"insecure": True}}  # noqa: S104


async def is_at_rest(base: Base) -> bool:
    """Whether the newest velocity is zero, and stays that for REST_S."""
    before = len(base.heard)
    await asyncio.sleep(REST_S)
    return not base.moves and not any(each.moves for each in base.heard[before:])
