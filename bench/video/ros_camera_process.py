"""A camera's node: publishes footage as sensor_msgs/msg/Image until SIGTERM; prints "ready" first."""

import signal
import sys
import time
from itertools import count
from pathlib import Path
from typing import Final

from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Image

from bench.video.camera import FRAME_BYTES, HEIGHT_PX, WIDTH_PX

_ENDINGS: Final = (signal.SIGINT, signal.SIGTERM)
_FRAMES: Final = 8
"""Made ahead, so that publishing is all that is left."""


def publish(footage: Path, topic: str, fps: int) -> None:
    # Before there is another thread, so that no thread takes them.
    signal.pthread_sigmask(signal.SIG_BLOCK, _ENDINGS)
    context = Context()
    context.init(args=[], initialize_logging=False)
    node = Node("bench_camera", context=context, use_global_arguments=False, enable_rosout=False)
    publisher = node.create_publisher(Image, topic, QoSProfile(depth=2))
    images = _images(footage)
    print("ready", flush=True)
    begun_s = time.monotonic()
    for number in count():
        if signal.sigtimedwait(_ENDINGS, max(0.0, begun_s + number / fps - time.monotonic())):
            break
        image = images[number % len(images)]
        image.header.stamp.sec, image.header.stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)
        publisher.publish(image)
    node.destroy_node()
    context.shutdown()


def _images(footage: Path) -> list[Image]:
    images = []
    with footage.open("rb") as file:
        for _ in range(_FRAMES):
            image = Image(width=WIDTH_PX, height=HEIGHT_PX, encoding="nv12", step=WIDTH_PX)
            image.data.frombytes(file.read(FRAME_BYTES))
            images.append(image)
    return images


if __name__ == "__main__":
    publish(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]))
