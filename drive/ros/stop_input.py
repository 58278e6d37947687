"""The robot's own stop, as its topics say it. Doubt counts as pressed."""

from collections.abc import Iterator
from typing import Any, Final

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from drive.config import DriveSettings
from drive.motion.values import MS
from drive.ros.subscriptions import newest, subscribe

_TYPE: Final = "std_msgs/msg/Bool"
_DEPTH: Final = 50
"""Messages of one cycle; a press among them that the next message releases must not be lost."""


def _qos(reliability: ReliabilityPolicy, durability: DurabilityPolicy) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=_DEPTH, reliability=reliability, durability=durability
    )


_LATCHED: Final = _qos(ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL)
_PROFILES: Final = (
    # What was published before this program started only reaches a subscription of the same durability.
    _LATCHED,
    _qos(ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE),
    # Matches publishers of either reliability.
    _qos(ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE),
)


class StopInput:
    """The robot's own stop, on one topic. It is active unless its one live publisher says that it is not.

    Args:
        node: of rclpy.
        topic: a std_msgs/Bool; true: stopped.
        timeout_ns: silence that counts as pressed; None: a publisher says what changes, and nothing else.

    Attributes:
        problem: why it is active although no one has pressed it, for people; empty otherwise.
    """

    def __init__(self, node: Any, topic: str, timeout_ns: int | None) -> None:
        self.topic = topic
        self.problem = ""
        self._node, self._timeout_ns = node, timeout_ns
        self._subscriptions = [subscribe(node, _TYPE, topic, qos) for qos in _PROFILES]
        self._publishers: frozenset[tuple[int, ...]] = frozenset()
        self._pressed: dict[int, bool] = {}
        """What each subscription has received last."""
        self._heard_ns = 0

    def active(self, now_ns: int) -> bool:
        """Takes what has arrived; returns whether the stop is active."""
        touched = self._take(now_ns)
        self._follow_publishers()
        several = len(self._publishers) > 1
        silent = self._timeout_ns is not None and now_ns - self._heard_ns > self._timeout_ns
        self.problem = ""
        if several:
            self.problem = (
                f"{len(self._publishers)} publishers on {self.topic}: which of them releases is unknown, "
                "so it counts as pressed; give each a topic of its own in stop_topics"
            )
        elif silent:
            self.problem = f"{self.topic} is silent, so it counts as pressed (stop_timeout_ms)"
        released = bool(self._pressed) and not any(self._pressed.values())
        return touched or several or silent or not self._publishers or not released

    def _take(self, now_ns: int) -> bool:
        """Takes what has arrived; returns whether any of it was a press, released since or not."""
        touched = False
        for index, subscription in enumerate(self._subscriptions):
            for pressed in _received(subscription):
                self._heard_ns = now_ns
                touched = touched or pressed
                # Of several publishers one must not release what another has pressed.
                if pressed or len(self._publishers) <= 1:
                    self._pressed[index] = pressed
        return touched

    def _follow_publishers(self) -> None:
        """Forgets what the topic has said when its publisher is another one, and asks that one."""
        before, self._publishers = self._publishers, self._present()
        changed = len(self._publishers) <= 1 and not self._publishers >= before
        if changed:
            self._pressed.clear()
            # What a latched publisher has said reaches a new subscription once more.
            self._node.destroy_subscription(self._subscriptions[0])
            self._subscriptions[0] = subscribe(self._node, _TYPE, self.topic, _LATCHED)

    def _present(self) -> frozenset[tuple[int, ...]]:
        try:
            found = self._node.get_publishers_info_by_topic(self.topic)
        except (RuntimeError, UnicodeError):
            # A program that announces a name that is no text: who publishes here is not known.
            return frozenset()
        return frozenset(tuple(each.endpoint_gid) for each in found)


def stop_inputs(node: Any, settings: DriveSettings) -> list[StopInput]:
    """Returns the robot's own stop, on each of its topics."""
    timeout_ns = settings.stop_timeout_ms * MS if settings.stop_timeout_ms is not None else None
    return [StopInput(node, topic, timeout_ns) for topic in settings.stop_topics]


def _received(subscription: Any) -> Iterator[bool]:
    """Yields what has arrived, in its order."""
    for _ in range(_DEPTH):
        message = newest(subscription)
        if message is None:
            return
        yield bool(message.data)
