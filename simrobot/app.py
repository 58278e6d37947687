"""Runs the simulated robot: one periodic task per topic, and the control socket."""

import asyncio
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from simrobot.behaviour import Behaviour, Topic
from simrobot.control import listening
from simrobot.publishers import publishing
from simrobot.rates import call_at_rate
from simrobot.robot import Robot


async def run_robot(
    stop: asyncio.Event, behaviour: Behaviour, rates_hz: Mapping[Topic, float], control: Path
) -> None:
    """Publishes until `stop` is set; prints a line with "ready" on standard output once it is running.

    Args:
        stop: stops the robot.
        behaviour: at the start.
        rates_hz: by topic; 0 creates no publisher.
        control: path of the control socket.

    Raises:
        UserError: ROS 2 or the control socket can't be used.
    """
    robot = Robot(behaviour, time.monotonic())

    def change(fields: dict[str, Any]) -> dict[str, Any]:
        return robot.change(fields, time.monotonic()).model_dump(mode="json")

    published = frozenset(topic for topic, rate_hz in rates_hz.items() if rate_hz > 0)
    with publishing(robot, published) as publish:
        async with listening(control, change), asyncio.TaskGroup() as group:
            tasks = [group.create_task(call_at_rate(rates_hz[topic], publish[topic])) for topic in publish]
            domain = os.environ.get("ROS_DOMAIN_ID") or "0"
            print(f"simrobot: ready on ROS domain {domain}, control socket {control}", flush=True)
            # A task ends only by an exception; the group then cancels this wait and raises it.
            await stop.wait()
            for task in tasks:
                task.cancel()
