"""Reads the talker's four topics until its standard input closes: `python -m bench.ros_listener WAY`.

WAY is "sampler" (ours), "callbacks" (an ordinary rclpy node on a SingleThreadedExecutor, whose callbacks
convert each message as ours does) or "newest" (the same node, whose callbacks only keep the message; a timer
converts it, as often as our sampler). At the end it prints how many values it kept.
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
from common.ros_node import ros_node
from common.ros_transport import chosen_transport
from common.sampler import SAMPLING_HZ, Sampler
from gateway.config import SourceSettings
from gateway.ros.readers import reader_for
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


def convert_each() -> int:
    board, kept = Board(), Counter[str]()

    def on_message(message: Any, source: SourceSettings) -> None:
        convert(message, source, board)
        kept[source.topic] += 1

    spin_node(on_message, None, kept)
    return kept.total()


def convert_newest() -> int:
    board, kept = Board(), Counter[str]()
    newest: dict[str, tuple[Any, SourceSettings]] = {}

    def on_message(message: Any, source: SourceSettings) -> None:
        newest[source.topic] = message, source

    def on_timer() -> None:
        for topic, (message, source) in newest.items():
            convert(message, source, board)
            kept[topic] += 1
        newest.clear()

    spin_node(on_message, on_timer, kept)
    return kept.total()


def convert(message: Any, source: SourceSettings, board: Board) -> None:
    board[source.spec] = Received(reader_for(source)(message, source), time.monotonic())


def spin_node(
    on_message: Callable[..., None], on_timer: Callable[[], None] | None, kept: Counter[str]
) -> None:
    """Runs an ordinary node until standard input closes."""
    context = Context()
    context.init(args=[], initialize_logging=False)
    node = Node("bench_callbacks", context=context, enable_rosout=False)
    for source in SOURCES:
        qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        node.create_subscription(Odometry, source.topic, partial(on_message, source=source), qos)
    if on_timer:
        node.create_timer(1 / SAMPLING_HZ, on_timer)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    thread = threading.Thread(target=spin, args=(executor,))
    thread.start()
    wait_for_the_end(lambda: len(kept) == len(SOURCES))
    executor.shutdown()
    thread.join()
    node.destroy_node()
    context.shutdown()


def spin(executor: Any) -> None:
    try:
        executor.spin()
    except ExternalShutdownException:
        return


def wait_for_the_end(everything_arrives: Callable[[], bool]) -> None:
    """Prints "ready" once all four topics arrive, so that no window includes discovery."""
    while not everything_arrives():
        time.sleep(0.05)
    print("ready", flush=True)
    sys.stdin.read()


if __name__ == "__main__":
    ways = {"sampler": sample, "callbacks": convert_each, "newest": convert_newest}
    with chosen_transport():
        print(ways[sys.argv[1]](), flush=True)
