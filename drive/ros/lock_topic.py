"""The topic of the robot's lock, in the graph."""

from typing import Any, Final

from common.ros_node import OWN_NODES, message_class
from drive.ros.subscriptions import NEWEST, newest, subscribe

_TYPE: Final = "std_msgs/msg/Bool"


class LockTopic:
    """Publishes and takes a std_msgs/Bool; `drive.ros.lock` decides when.

    Args:
        node: of rclpy.
        name: of the topic.
    """

    def __init__(self, node: Any, name: str) -> None:
        message_type = message_class(_TYPE)
        self.name = name
        self._node = node
        self._messages = {active: message_type(data=active) for active in (True, False)}
        self._publisher = node.create_publisher(message_type, name, NEWEST)
        self._subscription = subscribe(node, _TYPE, name)

    def publish(self, *, active: bool) -> None:
        """Publishes the lock, or its release."""
        self._publisher.publish(self._messages[active])

    def newest(self) -> bool | None:
        """Returns what was published last, here or by another program; None if there is nothing new."""
        message = newest(self._subscription)
        return None if message is None else bool(message.data)

    def others(self) -> tuple[str, ...]:
        """Returns the nodes of other programs that publish here, as far as they are discovered."""
        try:
            found = self._node.get_publishers_info_by_topic(self.name)
        except (RuntimeError, UnicodeError):
            # A node that has just gone, or a name that is no text: who publishes here is not known.
            return ("a program that can't be named",)
        return tuple(sorted({each.node_name for each in found} - OWN_NODES))
