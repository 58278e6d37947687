"""The real drive program as processes of their own, and a subscriber that notes what it publishes."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import psutil
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile

from common.ros_node import message_class
from tests.support.heard import Base, Heard
from tests.support.waiting import wait_until

_ROOT: Final = Path(__file__).parents[2]
_UP_WITHIN_S: Final = 60.0
"""rclpy takes seconds to import and to join the graph, many on a machine with other things to do."""
TOPIC: Final = "/cmd_vel_keyboard"
_TYPE: Final = "geometry_msgs/msg/TwistStamped"


@dataclass
class RunningDrive:
    """Guard and worker in the ROS domain of the environment."""

    process: subprocess.Popen[bytes]
    socket: Path
    log: Path

    @property
    def worker(self) -> psutil.Process:
        """The worker's process; one that was lost is replaced."""
        return worker_of(self.process)


def worker_of(guard: "subprocess.Popen[bytes]") -> psutil.Process:
    """Waits until a guard has a worker, if need be; returns it."""
    (worker,) = wait_until(psutil.Process(guard.pid).children, "a worker that drives")
    return worker


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
