"""Publishes odometry on four topics until its standard input closes: `python -m bench.ros_talker HZ`."""

import asyncio
import sys
from functools import partial
from typing import Any

from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile

from simrobot.rates import call_at_rate

TOPICS = tuple(f"/bench/odometry_{number}" for number in range(4))


async def talk(rate_hz: float) -> None:
    context = Context()
    context.init(args=[], initialize_logging=False)
    node = Node("bench_talker", context=context, enable_rosout=False)
    publishers = [node.create_publisher(Odometry, topic, QoSProfile(depth=10)) for topic in TOPICS]
    tasks = [
        asyncio.create_task(call_at_rate(rate_hz, partial(publish, each, Odometry()))) for each in publishers
    ]
    print("ready", flush=True)
    await asyncio.to_thread(sys.stdin.read)
    for task in tasks:
        task.cancel()
    node.destroy_node()
    context.shutdown()


def publish(publisher: Any, message: Any) -> None:
    message.twist.twist.linear.x += 1.0
    publisher.publish(message)


if __name__ == "__main__":
    asyncio.run(talk(float(sys.argv[1])))
