"""`python -m tests.support.stop_button TOPIC`: a stop button that all the time says false."""

import sys
import time

from common.ros_node import message_class, ros_node


def main() -> None:
    boolean = message_class("std_msgs/msg/Bool")
    with ros_node("button") as node:
        publisher = node.create_publisher(boolean, sys.argv[1], 1)
        while True:
            publisher.publish(boolean(data=False))
            time.sleep(0.1)


if __name__ == "__main__":
    main()
