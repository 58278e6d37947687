"""A camera in the ROS graph: publishes pictures of one colour, in a thread of its own."""

import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from sensor_msgs.msg import CompressedImage, Image

from bench.video.foreign import environment
from tests.support.talker import talking

PIXELS = {"red": (255, 0, 0), "green": (0, 255, 0), "blue": (0, 0, 255)}
"""Pure colours: what a picture's chroma is known of."""


def stamp(message: Any, age_s: float = 0.0) -> float:
    """Gives the message the stamp of an instant before now, which it returns as monotonic seconds."""
    system_ns, monotonic_s = time.time_ns(), time.monotonic()
    seconds, nanoseconds = divmod(system_ns - int(age_s * 1e9), 1_000_000_000)
    message.header.stamp.sec, message.header.stamp.nanosec = seconds, nanoseconds
    return monotonic_s - age_s


def picture(colour: str = "red", width: int = 320, height: int = 240, encoding: str = "rgb8") -> Image:
    """A picture of one colour; of the encodings besides rgb8, red alone."""
    red, green, blue = PIXELS[colour]
    rows = {
        "rgb8": [bytes((red, green, blue)) * width],
        "bgr8": [bytes((blue, green, red)) * width],
        "rgba8": [bytes((red, green, blue, 255)) * width],
        "bgra8": [bytes((blue, green, red, 255)) * width],
        # Luma 81, Cb 90, Cr 240 is red (ITU-R BT.601).
        "uyvy": [bytes((90, 81, 240, 81)) * (width // 2)],
        "yuyv": [bytes((81, 90, 81, 240)) * (width // 2)],
        "nv12": [bytes((81,)) * width],
        "bayer_rggb8": [bytes((255, 0)) * (width // 2), bytes(width)],
    }[encoding]
    data = b"".join(rows) * (height // len(rows))
    if encoding == "nv12":
        data += bytes((90, 240)) * (width * height // 4)
    message = Image(width=width, height=height, encoding=encoding, step=len(rows[0]))
    message.header.frame_id = "camera_link"
    message.data.frombytes(data)
    return message


def jpeg(colour: str, width: int = 320, height: int = 240, form: str = "jpeg") -> bytes:
    """A picture of one colour as a file, by GStreamer's own encoder."""
    with TemporaryDirectory() as directory:
        path = Path(directory) / "picture"
        raw = f"video/x-raw,width={width},height={height},framerate=1/1"
        made = f"videotestsrc num-buffers=1 pattern={colour} ! {raw} ! videoconvert ! {form}enc"
        command = f"gst-launch-1.0 -q {made} ! filesink location={path}"
        subprocess.run(command.split(), check=True, timeout=20, env=environment())
        return path.read_bytes()


def compressed(content: bytes, form: str) -> CompressedImage:
    """A compressed picture."""
    message = CompressedImage(format=form)
    message.data.frombytes(content)
    return message


class RosCamera:
    """Publishes what `shows` says at a steady rate; change it at any time."""

    def __init__(self, publisher: Any, message: Any, hz: float) -> None:
        self.shows = message
        self.age_s: float | None = 0.0
        """How long before its publication a picture was captured; None: the stamp stays as it is."""
        self.captured_s: list[float] = []
        """Stamps so far, monotonic."""
        self.published = 0
        self.hz = hz
        self._publisher = publisher
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ros camera")

    def start(self) -> None:
        """Begins."""
        self._thread.start()

    def stop(self) -> None:
        """Ends, once."""
        self._over.set()
        self._thread.join(10)

    @property
    def subscribers(self) -> int:
        """How many subscribe."""
        return int(self._publisher.get_subscription_count())

    def _run(self) -> None:
        due_s = time.monotonic()
        while not self._over.wait(max(0.0, due_s - time.monotonic())):
            due_s = max(due_s + 1 / self.hz, time.monotonic() - 1 / self.hz)
            if self.age_s is not None:
                self.captured_s.append(stamp(self.shows, self.age_s))
            self._publisher.publish(self.shows)
            self.published += 1


@contextmanager
def ros_camera(
    topic: str, message: Any = None, hz: float = 30.0, age_s: float | None = 0.0, **qos: Any
) -> Iterator[RosCamera]:
    """A camera at a topic, in the domain of the environment, until the block ends."""
    shown = picture() if message is None else message
    with talking("ros_camera") as talker:
        camera = RosCamera(talker.publisher(topic, type(shown), **{"depth": 2, **qos}), shown, hz)
        camera.age_s = age_s
        camera.start()
        try:
            yield camera
        finally:
            camera.stop()
