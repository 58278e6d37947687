"""Runs the simulated robot: one periodic task per topic, and the control socket."""

import asyncio
import os
import time
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import Any

from simrobot.base import Base
from simrobot.behaviour import Behaviour, Commander, Topic
from simrobot.control import listening
from simrobot.drive_train import DriveTrain, drive_train
from simrobot.messages import effective_command
from simrobot.mux import MuxInput
from simrobot.publishers import publishing
from simrobot.rates import COMMANDS_HZ, call_at_rate
from simrobot.robot import Robot


async def run_robot(
    stop: asyncio.Event,
    behaviour: Behaviour,
    rates_hz: Mapping[Topic, float],
    control: Path,
    *,
    with_base: bool = False,
) -> None:
    """Publishes until `stop` is set; prints a line with "ready" on standard output once it is running.

    Args:
        stop: stops the robot.
        behaviour: at the start.
        rates_hz: by topic; 0 creates no publisher.
        control: path of the control socket.
        with_base: whether the robot follows the velocities of the graph, through a mux and a base.

    Raises:
        UserError: ROS 2 or the control socket can't be used.
    """
    base = Base() if with_base else None
    robot = Robot(behaviour, time.monotonic(), base)

    def change(fields: dict[str, Any]) -> dict[str, Any]:
        return robot.change(fields, time.monotonic()).model_dump(mode="json")

    def heard() -> dict[str, Any] | None:
        return asdict(base.heard) if base and base.heard else None

    published = frozenset(topic for topic, rate_hz in rates_hz.items() if rate_hz > 0)
    if base:
        published -= {Topic.EFFECTIVE_COMMAND}  # The mux's, then.
    with publishing(robot, published) as publish, _drive_train(base) as train:
        actions = dict(publish)
        if train:
            actions[Topic.EFFECTIVE_COMMAND] = lambda: _use_joystick(robot, train)
        async with listening(control, change, heard), asyncio.TaskGroup() as group:
            tasks = [
                group.create_task(call_at_rate(rates_hz[topic] or COMMANDS_HZ, action))
                for topic, action in actions.items()
            ]
            domain = os.environ.get("ROS_DOMAIN_ID") or "0"
            print(f"simrobot: ready on ROS domain {domain}, control socket {control}", flush=True)
            # A task ends only by an exception; the group then cancels this wait and raises it.
            await stop.wait()
            for task in tasks:
                task.cancel()


def _drive_train(base: Base | None) -> AbstractContextManager[DriveTrain | None]:
    return drive_train(base) if base else nullcontext()


def _use_joystick(robot: Robot, train: DriveTrain) -> None:
    """Commands that are on none of the topics: of a joystick that is wired to the mux."""
    if robot.behaviour.commander is Commander.UNSEEN:
        train.forward(MuxInput.JOYSTICK, effective_command(robot, time.monotonic()))
