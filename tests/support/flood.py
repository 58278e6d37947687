"""A detector gone mad: `python -m tests.support.flood COUNT HZ` publishes frames of COUNT objects.

Encoded once, sent again and again until its standard input closes.
"""

import sys
import threading

from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from yolo_msgs.msg import Detection, DetectionArray

TOPIC = "/yolo/detections"


def main(count: int, rate_hz: float) -> None:
    over = threading.Event()

    def wait_for_the_end() -> None:
        sys.stdin.read()
        over.set()

    threading.Thread(target=wait_for_the_end, daemon=True).start()
    raw = serialize_message(
        DetectionArray(detections=[Detection(id=str(number), class_name="car") for number in range(count)])
    )
    context = Context()
    context.init(args=[], initialize_logging=False)
    node = Node("flood", context=context, use_global_arguments=False, enable_rosout=False)
    publisher = node.create_publisher(DetectionArray, TOPIC, QoSProfile(depth=1))
    print("ready", flush=True)
    while not over.wait(1 / rate_hz):
        publisher.publish(raw)
    node.destroy_node()
    context.shutdown()
    context.destroy()


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]))
