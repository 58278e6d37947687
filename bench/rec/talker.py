"""Publishes numbered messages until it is stopped: `python -m bench.rec.talker MB_PER_S`.

Odometry on four topics of 200 Hz, and images of 0.5 MB on one topic of 20 Hz for each 10 MB a second. The
images do not compress, as JPEG does not. A message's number, from 1 on, is in the seconds of its stamp.
Messages are serialised once, so that publishing costs little.

"numbers" on standard input prints the number of the newest message of each topic, as JSON; "stop" does so
after the last one. The program ends when its standard input closes.
"""

import heapq
import json
import os
import struct
import sys
import threading
import time
from dataclasses import dataclass
from typing import Any, Final

from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CompressedImage

ODOMETRIES: Final = 4
ODOMETRY_HZ: Final = 200
IMAGE_HZ: Final = 20
IMAGE_BYTES: Final = 500_000
IMAGE_MB_PER_S: Final = 10
"""Of a topic of images."""
_NUMBER: Final = struct.Struct("<i")
_NUMBER_AT: Final = 4
"""Behind the encapsulation header, the first field of std_msgs/Header."""
_HISTORY_BYTES: Final = 100_000_000
"""Of each publisher: what is lost is lost by the receiver."""


def number_of(data: bytes) -> int:
    """Returns the number of a message, serialised."""
    return int(_NUMBER.unpack_from(data, _NUMBER_AT)[0])


@dataclass(slots=True)
class _Topic:
    publisher: Any
    data: bytearray
    period_s: float
    number: int = 0

    def publish(self) -> None:
        self.number += 1
        _NUMBER.pack_into(self.data, _NUMBER_AT, self.number)
        self.publisher.publish(bytes(self.data))


def topics(node: Any, mb_per_s: int) -> dict[str, _Topic]:
    """Returns the topics by name."""
    image = CompressedImage(format="jpeg", data=os.urandom(IMAGE_BYTES))
    images = mb_per_s // IMAGE_MB_PER_S
    made = {}
    for kind, count, message, hz in (
        ("odometry", ODOMETRIES, Odometry(), ODOMETRY_HZ),
        ("image", images, image, IMAGE_HZ),
    ):
        data = serialize_message(message)
        depth = min(1000, _HISTORY_BYTES // len(data))
        for number in range(count):
            name = f"/bench/{kind}_{number}"
            publisher = node.create_publisher(type(message), name, QoSProfile(depth=depth))
            made[name] = _Topic(publisher, bytearray(data), 1 / hz)
    return made


def publish(all_topics: dict[str, _Topic], stop: threading.Event) -> None:
    """Publishes each topic at its rate, evenly spread, until `stop`."""
    began_s = time.monotonic()
    due = [
        (began_s + number / len(all_topics) * each.period_s, number, each)
        for number, each in enumerate(all_topics.values())
    ]
    heapq.heapify(due)
    while not stop.is_set():
        at_s, number, topic = due[0]
        time.sleep(max(0.0, at_s - time.monotonic()))
        topic.publish()
        heapq.heapreplace(due, (at_s + topic.period_s, number, topic))


def main(mb_per_s: int) -> None:
    context = Context()
    context.init(args=[], initialize_logging=False)
    node = Node("bench_talker", context=context, enable_rosout=False, start_parameter_services=False)
    all_topics = topics(node, mb_per_s)
    stop = threading.Event()
    publishing = threading.Thread(target=publish, args=(all_topics, stop))
    publishing.start()
    print("ready", flush=True)
    for line in sys.stdin:
        if line.strip() == "stop":
            stop.set()
            publishing.join()
        print(json.dumps({name: each.number for name, each in all_topics.items()}), flush=True)
    stop.set()
    publishing.join()
    node.destroy_node()
    context.shutdown()


if __name__ == "__main__":
    main(int(sys.argv[1]))
