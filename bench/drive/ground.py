"""What the benchmarks of driving share: a drive program with its base, and gateways and drivers for it."""

import asyncio
import json
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from bench.processes import program
from bench.ros_domain import ros_domain
from tests.support.driven_robot import (
    DrivenRobot,
    available,
    driven_base,
    gateway_for,
    network_settings,
)
from tests.support.free import free_tcp_port
from tests.support.heard import Base
from tests.support.running_drive import RunningDrive
from tests.support.tcp_link import TcpLink
from tests.support.udp_link import Impairment

ONE_WAY_S: Final = 0.01
"""Of the links that lose packets: a round trip of 20 ms."""


@dataclass(frozen=True, slots=True)
class Ground:
    """A drive program before the multiplexer, and a base behind it.

    Attributes:
        directory: for sockets, state and logs.
    """

    directory: Path
    base: Base
    drive: RunningDrive

    @property
    def worker_pid(self) -> int:
        """Process ID of the worker, which the guard replaces when it is lost."""
        return self.drive.worker.pid

    @contextmanager
    def robot(self) -> Iterator[DrivenRobot]:
        """Yields the robot, free to be driven, with a gateway of its own, which may be killed."""
        settings = network_settings(free_tcp_port())
        with gateway_for(self.directory, self.base, self.drive, **settings) as robot:
            asyncio.run(_make_available(robot))
            yield robot


@contextmanager
def driven_ground(directory: Path) -> Iterator[Ground]:
    """In a ROS domain of its own."""
    with ros_domain(), driven_base(directory) as (base, drive):
        yield Ground(directory, base, drive)


def link(robot: DrivenRobot, loss: float = 0.0, seed: int = 1) -> TcpLink:
    """Returns a link to a robot with a gateway that networks reach, as `link_to`."""
    return link_to(robot.gateway.port, loss, seed)


def link_to(port: int, loss: float = 0.0, seed: int = 1) -> TcpLink:
    """Returns a link with a round trip of 20 ms.

    Args:
        port: of the gateway, which networks reach.
        loss: share of lost packets, each way.
        seed: of the losses.
    """
    up, down = (Impairment(loss=loss, delay_s=ONE_WAY_S) for _ in range(2))
    return TcpLink(port, up, down, seed)


@dataclass(frozen=True, slots=True)
class Driver:
    """A driver in a process of its own (bench.drive.driver), who moves the robot."""

    process: subprocess.Popen[str]

    def ask(self, word: str) -> Any:
        """Returns the answer to a word of bench.drive.driver."""
        assert self.process.stdin
        assert self.process.stdout
        self.process.stdin.write(f"{word}\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())


@contextmanager
def driver(target: str, *arguments: str) -> Iterator[Driver]:
    """Yields a driver who moves the robot; they release when the block ends."""
    with program("bench.drive.driver", target, *arguments) as process:
        yield Driver(process)


async def _make_available(robot: DrivenRobot) -> None:
    async with available(robot):
        pass
