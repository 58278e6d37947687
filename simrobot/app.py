"""The running robot: publishers on their beats and the control socket, until it is told to stop."""

import asyncio
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from simrobot.beat import beat
from simrobot.behaviour import Behaviour, Topic
from simrobot.control import listening
from simrobot.publishers import publishing
from simrobot.robot import Robot


async def run_robot(
    stop: asyncio.Event, behaviour: Behaviour, rates_hz: Mapping[Topic, float], control: Path
) -> None:
    """Publishes until `stop` is set; says "ready" on standard output when everything is up.

    Args:
        stop: ends the robot.
        behaviour: how it starts.
        rates_hz: 0 leaves the topic out of the graph altogether.
        control: where the control socket goes.

    Raises:
        UserError: ROS 2 or the control socket can't be used.
    """
    robot = Robot(behaviour, time.monotonic())

    def change(wish: dict[str, Any]) -> dict[str, Any]:
        return robot.change(wish, time.monotonic()).model_dump(mode="json")

    published = frozenset(topic for topic, rate_hz in rates_hz.items() if rate_hz > 0)
    with publishing(robot, published) as actions:
        async with listening(control, change), asyncio.TaskGroup() as beats:
            tasks = [beats.create_task(beat(rates_hz[topic], action)) for topic, action in actions.items()]
            domain = os.environ.get("ROS_DOMAIN_ID") or "0"
            print(f"simrobot: ready on ROS domain {domain}, control socket {control}", flush=True)
            # A beat only ends by failing; then the group cancels this wait and the error comes out.
            await stop.wait()
            for task in tasks:
                task.cancel()
