"""The mux and the base in the ROS 2 graph: two nodes, named as on the first robot, each on its own thread."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import astuple
from functools import partial
from typing import Any, Final

from common.ros_node import message_class, ros_node
from simrobot.base import TIMEOUT_S, Base, Twist
from simrobot.mux import LOCK_PRIORITY, Mux, MuxInput

INPUTS: Final = {
    MuxInput.NAVIGATION: "/cmd_vel_nav",
    MuxInput.AUTONOMY: "/cmd_vel_autonomy",
    MuxInput.KEYBOARD: "/cmd_vel_keyboard",
}
LOCK: Final = "/cmd_vel_emergency_stop"
OUTPUT: Final = "/mecanum_drive_controller/reference"
_DEPTH: Final = 10
_END_S: Final = 5.0


class DriveTrain:
    """Passes velocities from the mux's inputs to the base.

    Args:
        mux_node, base_node: of rclpy; an executor spins them.
        base: receives what the mux forwards.
    """

    def __init__(self, mux_node: Any, base_node: Any, base: Base) -> None:
        self._mux = Mux()
        self._base = base
        twist_stamped, boolean = (
            message_class(name) for name in ("geometry_msgs/msg/TwistStamped", "std_msgs/msg/Bool")
        )
        # The executor's thread brings the topics' messages, the event loop's the joystick's.
        self._one_at_a_time = threading.Lock()
        self._output = mux_node.create_publisher(twist_stamped, OUTPUT, _DEPTH)
        for source, topic in INPUTS.items():
            mux_node.create_subscription(twist_stamped, topic, partial(self.forward, source), _DEPTH)
        mux_node.create_subscription(boolean, LOCK, self._lock, _DEPTH)
        # As of twist_mux. The joystick, on no topic, has none.
        for source, topic in INPUTS.items():
            self._declare(mux_node, f"topics.{source.name.lower()}", topic, *astuple(source.value))
        self._declare(mux_node, "locks.stop", LOCK, LOCK_PRIORITY, 0.0)
        base_node.create_subscription(twist_stamped, OUTPUT, self._receive, _DEPTH)
        # As of the mecanum drive controller of ros2_controllers.
        base_node.declare_parameter("reference_timeout", TIMEOUT_S)

    @staticmethod
    def _declare(node: Any, name: str, topic: str, priority: int, timeout_s: float) -> None:
        for key, value in (("topic", topic), ("priority", priority), ("timeout", timeout_s)):
            node.declare_parameter(f"{name}.{key}", value)

    def forward(self, source: MuxInput, message: Any) -> None:
        """Takes a message of one source; publishes it if the mux selects it."""
        with self._one_at_a_time:
            if self._mux.forwards(source, time.monotonic()):
                self._output.publish(message)

    def _lock(self, message: Any) -> None:
        with self._one_at_a_time:
            self._mux.locked = message.data

    def _receive(self, message: Any) -> None:
        twist = message.twist
        self._base.receive(Twist(twist.linear.x, twist.linear.y, twist.angular.z), time.monotonic())


@contextmanager
def drive_train(base: Base) -> Iterator[DriveTrain]:
    """Yields the drive train, in the graph while the block lasts.

    Raises:
        UserError: ROS 2 can't be used.
    """
    # Late: without rclpy, common.ros_node says what to type.
    from rclpy.executors import SingleThreadedExecutor  # noqa: PLC0415

    with (
        ros_node("twist_mux", parameters=True) as mux_node,
        ros_node("mecanum_drive_controller", parameters=True) as base_node,
    ):
        made = DriveTrain(mux_node, base_node, base)
        executors = [SingleThreadedExecutor(context=node.context) for node in (mux_node, base_node)]
        threads = []
        for executor, node in zip(executors, (mux_node, base_node), strict=True):
            executor.add_node(node)
            thread = threading.Thread(target=executor.spin, name=node.get_name(), daemon=True)
            thread.start()
            threads.append(thread)
        try:
            yield made
        finally:
            for executor, thread in zip(executors, threads, strict=True):
                executor.shutdown()
                thread.join(_END_S)
