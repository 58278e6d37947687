"""Reads the talker's four topics until its standard input closes: `python -m bench.ros_listener WAY`.

WAY is "sampler" (ours) or "callbacks": an ordinary rclpy node on a SingleThreadedExecutor, whose callbacks do
what ours does with a message. At the end it prints how many values it kept.
"""

import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from bench.ros_talker import TOPICS
from gateway.config import SourceSettings
from gateway.ros.lifetime import ros_node
from gateway.ros.readers import reader_for
from gateway.ros.sampler import Sampler
from gateway.ros.source import Source
from gateway.ros.subscription import subscribe
from gateway.status.board import Board
from gateway.status.values import Received

SOURCES = tuple(
    SourceSettings(kind="odometry", topic=topic, type="nav_msgs/msg/Odometry", stale_after_ms=1000)
    for topic in TOPICS
)


def sample() -> int:
    with ros_node("bench_sampler") as node:
        board = Board()
        sources = [
            Source(each, subscribe(node, each), board, created_at_s=time.monotonic()) for each in SOURCES
        ]
        with Sampler(sources, board):
            wait_for_the_end(lambda: all(source.counts.values for source in sources))
        return sum(source.counts.values for source in sources)


def call_back() -> int:
    context = Context()
    context.init(args=[], initialize_logging=False)
    node = Node("bench_callbacks", context=context, enable_rosout=False)
    board, kept = Board(), Counter[str]()

    def on_message(message: Any, source: SourceSettings) -> None:
        value = reader_for(source)(message, source)
        board[source.spec] = Received(value, time.monotonic())
        kept[source.topic] += 1

    for source in SOURCES:
        qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        node.create_subscription(Odometry, source.topic, partial(on_message, source=source), qos)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    thread = threading.Thread(target=spin, args=(executor,))
    thread.start()
    wait_for_the_end(lambda: len(kept) == len(SOURCES))
    executor.shutdown()
    thread.join()
    node.destroy_node()
    context.shutdown()
    return kept.total()


def spin(executor: Any) -> None:
    try:
        executor.spin()
    except ExternalShutdownException:
        return


def wait_for_the_end(everything_arrives: Callable[[], bool]) -> None:
    """Ready is who hears all four topics: a window in which discovery still goes on would be too cheap."""
    while not everything_arrives():
        time.sleep(0.05)
    print("ready", flush=True)
    sys.stdin.read()


if __name__ == "__main__":
    print({"sampler": sample, "callbacks": call_back}[sys.argv[1]](), flush=True)
