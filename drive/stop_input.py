"""The robot's own stop, as its topics say it."""

from typing import Any, Final

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from drive.subscriptions import BEST_EFFORT, NEWEST, newest, subscribe

_LATCHED: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)


class StopInput:
    """The robot's own stop, on one topic. It is active unless a live publisher says that it is not."""

    def __init__(self, node: Any, topic: str) -> None:
        self._node, self._topic = node, topic
        # What was published before this program started only reaches a subscription of the same durability.
        self._subscriptions = [subscribe(node, "std_msgs/msg/Bool", topic, qos) for qos in (NEWEST, _LATCHED)]
        self._best_effort = subscribe(node, "std_msgs/msg/Bool", topic, BEST_EFFORT)
        self._released = False

    def active(self) -> bool:
        """Takes what has arrived; returns whether the stop is active."""
        taken = [newest(each) for each in (*self._subscriptions, self._best_effort)]
        said = [bool(message.data) for message in taken if message]
        if said:
            self._released = not any(said)
        if self._node.count_publishers(self._topic) == 0:
            self._released = False
        return not self._released
