"""A DDS participant whose node name is not UTF-8: `python -m tests.support.undecodable_peer TOPIC`.

rcl refuses such a name, but the participant's discovery message (ros_discovery_info) can carry any bytes, and
a participant of another vendor, or of an attacker, may send them. Here the name is overwritten in this
process's own memory after rcl has accepted it; a second node then makes the middleware announce both again.
Publishes nav_msgs/Odometry on TOPIC, ten times a second, until its standard input closes.
"""

import sys
import threading
from pathlib import Path
from typing import Final

from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.node import Node

_NAME: Final = b"undecodable_peer_of_the_gateway"
_OVERWRITTEN: Final = _NAME.replace(b"undecodable", b"\xff\xfe\xf0ecodable")
_PUBLISH_EVERY_S: Final = 0.1


def main(topic: str) -> None:
    ended = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
    context = Context()
    context.init(args=[], initialize_logging=False)
    node = Node(_NAME.decode(), context=context, use_global_arguments=False, enable_rosout=False)
    publisher = node.create_publisher(Odometry, topic, 10)
    _overwrite_name()
    Node("announcer", context=context, use_global_arguments=False, enable_rosout=False)
    print("ready", flush=True)
    while not ended.wait(_PUBLISH_EVERY_S):
        publisher.publish(Odometry())
    context.shutdown()


def _overwrite_name() -> None:
    """Replaces every copy of the name in this process's writable memory."""
    with Path("/proc/self/mem").open("r+b", buffering=0) as memory:
        for line in Path("/proc/self/maps").read_text(encoding="utf-8").splitlines():
            addresses, permissions = line.split()[:2]
            if not permissions.startswith("rw") or "[v" in line:
                continue
            begin, end = (int(each, 16) for each in addresses.split("-"))
            try:
                memory.seek(begin)
                content = memory.read(end - begin)
            except OSError:
                continue  # a mapping that can't be read holds no name
            found = content.find(_NAME)
            while found >= 0:
                memory.seek(begin + found)
                memory.write(_OVERWRITTEN)
                found = content.find(_NAME, found + 1)


if __name__ == "__main__":
    main(sys.argv[1])
