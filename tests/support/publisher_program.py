"""A publisher in a process of its own: `python -m tests.support.publisher_program TOPIC HZ BYTES COUNT ...`.

Publishes COUNT messages of std_msgs/msg/String with BYTES letters on each TOPIC (four arguments each): the
first one as soon as each topic has a subscription, then prints "first" and waits for a line of its standard
input, and the others HZ times a second. Then it prints how many it has published and waits for the end of
its standard input.
"""

import json
import sys
import time
from dataclasses import dataclass
from typing import Any

from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import String

_MEET_WITHIN_S = 30.0
_POLL_S = 0.005
_MAX_HISTORY = 100_000_000


@dataclass
class _Job:
    publisher: Any
    period_s: float
    message: Any
    count: int
    published: int = 0
    due_s: float = 0.0

    def publish(self) -> None:
        self.publisher.publish(self.message)
        self.published += 1


def main(arguments: list[str]) -> None:
    context = Context()
    context.init(args=[], initialize_logging=False)
    node = Node("publisher_program", context=context, use_global_arguments=False, enable_rosout=False)
    jobs = []
    for topic, hz, size, count in zip(*(iter(arguments),) * 4, strict=True):
        # Reliable, so that what is lost is lost by the receiver's queue.
        qos = QoSProfile(depth=max(10, min(1000, _MAX_HISTORY // int(size))))
        publisher = node.create_publisher(String, topic, qos)
        jobs.append(_Job(publisher, 1 / float(hz), String(data="x" * int(size)), int(count)))
    _meet(jobs)
    for job in jobs:
        job.publish()
    print("first", flush=True)
    sys.stdin.readline()
    _publish(jobs)
    print(json.dumps([job.published for job in jobs]), flush=True)
    sys.stdin.read()
    node.destroy_node()
    context.shutdown()


def _meet(jobs: list[_Job]) -> None:
    until_s = time.monotonic() + _MEET_WITHIN_S
    while not all(job.publisher.get_subscription_count() for job in jobs):
        assert time.monotonic() < until_s, "nothing subscribes"
        time.sleep(_POLL_S)


def _publish(jobs: list[_Job]) -> None:
    start_s = time.monotonic()
    for job in jobs:
        job.due_s = start_s
    while waiting := [job for job in jobs if job.published < job.count]:
        job = min(waiting, key=lambda each: each.due_s)
        time.sleep(max(0.0, job.due_s - time.monotonic()))
        job.publish()
        job.due_s += job.period_s


if __name__ == "__main__":
    main(sys.argv[1:])
