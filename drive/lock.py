"""The lock of the robot's multiplexer, which other programs may publish as well.

The multiplexer keeps what was said last, whoever said it: a release would end another program's lock, too.
"""

import time
from typing import Any, Final

from common.ros_node import OWN_NODES, message_class
from drive.subscriptions import NEWEST, newest, subscribe
from drive.values import MS

_TYPE: Final = "std_msgs/msg/Bool"
_LOOK_EVERY_NS: Final = 500 * MS
"""At the graph: who publishes."""
_TAKE_EVERY_NS: Final = 100 * MS
_OWN_ECHO_NS: Final = 200 * MS
"""What was published here has come back by then."""


class Lock:
    """Publishes the lock, and its release where that can only end a lock of this program.

    Args:
        node: of rclpy.
        topic: a std_msgs/Bool; true: locked.
    """

    def __init__(self, node: Any, topic: str) -> None:
        message_type = message_class(_TYPE)
        self._node, self._topic = node, topic
        self._on, self._off = message_type(data=True), message_type(data=False)
        self._publisher = node.create_publisher(message_type, topic, NEWEST)
        self._subscription = subscribe(node, _TYPE, topic)
        self._wanted = self._active = False
        """For a stop; and as it was said last, here or by another program."""
        self._others: tuple[str, ...] = ()
        """Nodes that publish it, too, when last looked for."""
        self._looked_ns = self._take_due_ns = 0

    def publish(self, *, active: bool) -> None:
        """Locks; or releases, unless another program may hold the lock."""
        self._wanted = active
        if active:
            self._active = True
            self._publisher.publish(self._on)
            return
        self._look()
        if not self._others:
            self._active = False
            self._take_due_ns = time.monotonic_ns() + _OWN_ECHO_NS
            self._publisher.publish(self._off)

    def observe(self, now_ns: int) -> None:
        """Takes what has arrived; while the lock is active, looks for other programs that publish it."""
        if now_ns >= self._take_due_ns:
            self._take_due_ns = now_ns + _TAKE_EVERY_NS
            if message := newest(self._subscription):
                self._active = bool(message.data)
        if self._active and now_ns - self._looked_ns >= _LOOK_EVERY_NS:
            self._looked_ns = now_ns
            self._look()

    @property
    def problem(self) -> str:
        """Why the lock is active without a stop, or will be after its reset, for people; empty otherwise."""
        names = ", ".join(self._others)
        if self._wanted:
            return (
                f"{names} publishes the lock on {self._topic}, too: the reset of a stop does not release it"
                if names
                else ""
            )
        if not self._active:
            return ""
        return (
            f"the lock on {self._topic} is active, and nothing of lower priority moves the robot: release it "
            f"where it was pressed ({names or 'by a program that has gone'}); if it is only left of a stop, "
            f"type: ros2 topic pub --once {self._topic} {_TYPE} '{{data: false}}'"
        )

    def _look(self) -> None:
        try:
            found = self._node.get_publishers_info_by_topic(self._topic)
        except (RuntimeError, UnicodeError):
            # A node that has just gone, or a name that is no text: who publishes here is not known.
            self._others = ("a program that can't be named",)
            return
        self._others = tuple(sorted({each.node_name for each in found} - OWN_NODES))
