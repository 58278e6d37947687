"""A publisher and a subscriber of the robot's own, each a process: what they lose, another has cost.

`python -m tests.support.pair talk` publishes numbers 200 times a second; `... listen` collects them. Both end
when their standard input does; the talker prints how many it sent, the listener the numbers it got.
"""

import json
import sys
import threading
import time
from typing import Any

from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import UInt64

TOPIC = "/the_robots_own"
RATE_HZ = 200
_QOS = QoSProfile(depth=1000)


def main() -> None:
    over = threading.Event()

    def wait_for_the_end() -> None:
        sys.stdin.read()
        over.set()

    threading.Thread(target=wait_for_the_end, daemon=True).start()
    context = Context()
    context.init(args=[], initialize_logging=False)
    node = Node("pair_" + sys.argv[1], context=context, use_global_arguments=False, enable_rosout=False)
    try:
        {"talk": _talk, "listen": _listen}[sys.argv[1]](context, node, over)
    finally:
        node.destroy_node()
        context.shutdown()
        context.destroy()


def _talk(_context: Any, node: Any, over: threading.Event) -> None:
    publisher = node.create_publisher(UInt64, TOPIC, _QOS)
    while publisher.get_subscription_count() == 0 and not over.wait(0.01):
        pass
    print("met", flush=True)
    started_s, sent = time.monotonic(), 0
    while not over.is_set():
        publisher.publish(UInt64(data=sent))
        sent += 1
        over.wait(max(0.0, started_s + sent / RATE_HZ - time.monotonic()))
    # What is on its way arrives before the writer leaves.
    publisher.wait_for_all_acked()
    print(sent, flush=True)


def _listen(context: Any, node: Any, over: threading.Event) -> None:
    got: list[int] = []
    node.create_subscription(UInt64, TOPIC, lambda message: got.append(message.data), _QOS)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    while not over.is_set():
        executor.spin_once(timeout_sec=0.1)
    print(json.dumps(got), flush=True)
    executor.shutdown()


if __name__ == "__main__":
    main()
