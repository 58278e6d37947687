"""The real drive program as processes of their own, and a subscriber that notes what it publishes."""

import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile

from common.ros_node import message_class
from tests.support.waiting import wait_until

_ROOT: Final = Path(__file__).parents[2]
_UP_WITHIN_S: Final = 60.0
"""rclpy takes seconds to import and to join the graph, many on a machine with other things to do."""
_EXPLAINING_LINES: Final = 20
TOPIC: Final = "/cmd_vel_keyboard"
_TYPE: Final = "geometry_msgs/msg/TwistStamped"


@dataclass
class RunningDrive:
    """Guard and worker in the ROS domain of the environment."""

    process: subprocess.Popen[bytes]
    socket: Path
    log: Path

    @contextmanager
    def explaining(self) -> Iterator[None]:
        """Adds what the program has logged to an error."""
        try:
            yield
        except BaseException as error:
            lines = self.log.read_text(encoding="utf-8").splitlines()
            error.add_note("\n".join(["drive.log:", *lines[-_EXPLAINING_LINES:]]))
            raise


@contextmanager
def running_drive(directory: Path, **settings: Any) -> Iterator[RunningDrive]:
    """Listening when the block begins, gone when it ends."""
    config, path = directory / "drive.yaml", directory / "drive.sock"
    values = {
        "socket": str(path),
        "state_dir": str(directory / "drive-state"),
        "mux_output": None,
        "odometry": None,
        **settings,
    }
    config.write_text(json.dumps(values), encoding="utf-8")  # JSON is YAML
    command = [sys.executable, "-c", "from drive.cli import main; main()", "serve", "--config", str(config)]
    log = directory / "drive.log"
    with log.open("ab") as output:
        # A group of its own: the guard's worker ends with it, whatever a test does to the guard.
        process = subprocess.Popen(command, cwd=_ROOT, stderr=output, process_group=0)
    try:
        wait_until(path.exists, "the drive program listens", _UP_WITHIN_S)
        yield RunningDrive(process, path, log)
    finally:
        process.terminate()
        with suppress(subprocess.TimeoutExpired):
            process.wait(5)
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@dataclass(frozen=True)
class Heard:
    """A velocity that reached the subscriber.

    Attributes:
        at_s: when, by CLOCK_MONOTONIC.
        stamp_s: its stamp, by the publisher's calendar clock.
    """

    at_s: float
    stamp_s: float
    vx_mps: float
    vy_mps: float
    wz_rad_s: float

    @property
    def moves(self) -> bool:
        return (self.vx_mps, self.vy_mps, self.wz_rad_s) != (0.0, 0.0, 0.0)


@dataclass
class Base:
    """What takes the velocities, as a robot's base would."""

    heard: list[Heard] = field(default_factory=list)

    @property
    def moves(self) -> bool:
        """Whether the newest velocity is motion."""
        return bool(self.heard) and self.heard[-1].moves

    def stopped_after_s(self, since_s: float) -> float:
        """Returns how long after an instant zero has come that no motion followed.

        0 without motion and without a zero after it; infinite if the motion never ended.
        """
        last_s = max((each.at_s for each in self.heard if each.moves and each.at_s >= since_s), default=None)
        zeros_s = (each.at_s for each in self.heard if not each.moves and each.at_s >= (last_s or since_s))
        return next(zeros_s, since_s if last_s is None else math.inf) - since_s


@contextmanager
def listening_base(topic: str = TOPIC) -> Iterator[Base]:
    """A base in the domain of the environment."""
    context = Context()
    context.init(args=[], initialize_logging=False)
    node = Node("base", context=context, use_global_arguments=False, enable_rosout=False)
    base = Base()

    def hear(message: Any) -> None:
        twist, stamp = message.twist, message.header.stamp
        stamp_s = stamp.sec + stamp.nanosec / 1e9
        base.heard.append(Heard(time.monotonic(), stamp_s, twist.linear.x, twist.linear.y, twist.angular.z))

    node.create_subscription(message_class(_TYPE), topic, hear, QoSProfile(depth=50))
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, name="base")
    thread.start()
    try:
        yield base
    finally:
        executor.shutdown()
        context.try_shutdown()
        thread.join(10)
        node.destroy_node()
        context.destroy()
