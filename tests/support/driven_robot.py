"""A robot to drive: the real gateway and drive program in processes of their own, and a base that listens."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from console.client import DriveOptions, DriveSession, Supervision
from tests.support.eventually import eventually
from tests.support.gateway_program import GatewayProgram, gateway_program
from tests.support.running_drive import Base, RunningDrive, listening_base, running_drive
from tests.support.waiting import wait_until

REST_S = 0.3
"""Longer than any message takes that is on its way."""
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
def driven_robot(
    directory: Path, *, drive: dict[str, Any] | None = None, **settings: Any
) -> Iterator[DrivenRobot]:
    """Ready to be driven when the block begins; in the ROS domain of the environment."""
    with listening_base() as base, running_drive(directory, **(drive or {})) as program:
        teleop = {"socket": str(program.socket), **TELEOP, **settings.pop("teleop", {})}
        with gateway_program(directory, sources=[], teleop=teleop, **settings) as gateway:
            robot = DrivenRobot(gateway, program, base)
            wait_until(lambda: robot.teleop.enabled, "driving is enabled")
            yield robot


async def in_motion(session: DriveSession, base: Base, speed_mps: float) -> None:
    """Holds until the base has motion."""
    await session.ready(within_s=15)

    async def moves() -> bool:
        session.hold(speed_mps)
        return base.moves

    await eventually(moves, bool, "the base moves")


async def is_at_rest(base: Base) -> bool:
    """Whether the newest velocity is zero, and stays that for REST_S."""
    before = len(base.heard)
    await asyncio.sleep(REST_S)
    return not base.moves and not any(each.moves for each in base.heard[before:])
