"""The robot's base as the ROS 2 graph shows it, and the publisher of its velocities."""

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

from rclpy.duration import Duration

from common.ros_node import OWN_NODES, OwnNode, message_class, ros_node
from drive.config import DriveSettings, Output
from drive.other_sources import OtherSources
from drive.outranking import Outranking
from drive.stop_input import stop_inputs
from drive.subscriptions import NEWEST, is_still, newest, subscribe, velocity_of
from drive.values import MS, Surroundings, Velocity

_log = logging.getLogger(__name__)

_ODOMETRY_NS: Final = 500 * MS
"""Older odometry says nothing about now."""
_LOOK_EVERY_NS: Final = 500 * MS
"""At the graph: who subscribes."""
_ACKNOWLEDGED_S: Final = 0.04
"""Within the guard's patience; on a robot an acknowledgement takes a millisecond."""


class VelocityPublisher:
    """Publishes velocities and the lock. Used by the worker, and by the guard when the worker is gone.

    Args:
        node: of rclpy.
        outputs: inputs of the robot's multiplexer.
        lock_topic: None if it can't be locked.
    """

    def __init__(self, node: Any, outputs: Sequence[Output], lock_topic: str | None) -> None:
        self._clock = node.get_clock()
        self._outputs = [
            (
                output,
                message_class(output.type),
                node.create_publisher(message_class(output.type), output.topic, NEWEST),
            )
            for output in outputs
        ]
        self._lock_type = message_class("std_msgs/msg/Bool")
        self._lock = node.create_publisher(self._lock_type, lock_topic, NEWEST) if lock_topic else None

    def publish(self, velocity: Velocity) -> None:
        """Publishes a velocity on all outputs, stamped now: some controllers reject by the stamp's age."""
        for output, message_type, publisher in self._outputs:
            message = message_type()
            twist = message
            if output.type.endswith("Stamped"):
                message.header.stamp = self._clock.now().to_msg()
                message.header.frame_id = output.frame_id
                twist = message.twist
            twist.linear.x = velocity.vx_mps
            twist.linear.y = velocity.vy_mps
            twist.angular.z = velocity.wz_rad_s
            publisher.publish(message)

    def lock(self, *, active: bool) -> None:
        """Locks or unlocks the multiplexer, where it can be."""
        if self._lock:
            self._lock.publish(self._lock_type(data=active))

    def matched(self) -> int:
        """Returns how many subscriptions take the velocities, observers included."""
        return sum(publisher.get_subscription_count() for _, _, publisher in self._outputs)

    def wait_until_acknowledged(self) -> None:
        """Waits, for a moment, until reliable subscribers have the last velocity: before the process ends."""
        for _, _, publisher in self._outputs:
            publisher.wait_for_all_acked(Duration(seconds=_ACKNOWLEDGED_S))


class _Takers:
    """Whether anything but this project's own observers takes the velocities, on each leg of their way."""

    def __init__(self, node: Any, velocities: VelocityPublisher, settings: DriveSettings) -> None:
        self._node = node
        self._velocities = velocities
        self._outputs = [output.topic for output in settings.outputs]
        self._mux_output = settings.mux_output.topic if settings.mux_output else None
        self._counts: tuple[int, int] | None = None
        self._observers = 0, 0
        self._looked_ns = 0

    def problems(self, now_ns: int) -> list[str]:
        """Returns what is missing; looking closely only when a count has changed, and now and then."""
        counts = self._velocities.matched(), self._count(self._mux_output)
        if counts != self._counts or now_ns - self._looked_ns >= _LOOK_EVERY_NS:
            self._counts, self._looked_ns = counts, now_ns
            on_outputs = sum(self._observers_of(topic) for topic in self._outputs)
            self._observers = on_outputs, self._observers_of(self._mux_output)
        problems = []
        if counts[0] <= self._observers[0]:
            problems.append(f"nothing takes the velocities on {', '.join(self._outputs)}")
        if self._mux_output and counts[1] <= self._observers[1]:
            problems.append(f"no base takes the velocities on {self._mux_output}")
        return problems

    def _count(self, topic: str | None) -> int:
        return int(self._node.count_subscribers(topic)) if topic else 0

    def _observers_of(self, topic: str | None) -> int:
        if topic is None:
            return 0
        try:
            found = self._node.get_subscriptions_info_by_topic(topic)
        except (RuntimeError, UnicodeError) as error:
            # A program that announces a name that is no text; then all that is known is their number.
            _log.debug("the subscribers of %s can't be listed: %s", topic, error)
            return 0
        return sum(each.node_name in OWN_NODES for each in found)


class Base:
    """What the graph says about the base, and the publisher of its velocities."""

    def __init__(self, node: Any, settings: DriveSettings) -> None:
        self._velocities = VelocityPublisher(node, settings.outputs, settings.lock_topic)
        self._takers = _Takers(node, self._velocities, settings)
        self._outranking = Outranking() if settings.mux_output else None
        self._mux_output = (
            subscribe(node, settings.mux_output.type, settings.mux_output.topic)
            if settings.mux_output
            else None
        )
        self._odometry = (
            subscribe(node, "nav_msgs/msg/Odometry", settings.odometry) if settings.odometry else None
        )
        watched = (*settings.outputs, *((settings.mux_output,) if settings.mux_output else ()))
        self._other_sources = OtherSources(
            node, [output.topic for output in settings.outputs], {each.topic for each in watched}
        )
        self._stops = stop_inputs(node, settings)
        self._problems: list[str] = []
        self._still: tuple[int, bool] | None = None

    def publish(self, velocity: Velocity, now_ns: int) -> None:
        """Publishes a velocity, and remembers it for the comparison with what reaches the base."""
        self._velocities.publish(velocity)
        if self._outranking:
            self._outranking.published(velocity, now_ns)

    def lock(self, *, active: bool) -> None:
        """Locks or unlocks the multiplexer, where it can be."""
        self._velocities.lock(active=active)

    def wait_until_acknowledged(self) -> None:
        """Waits, for a moment, until reliable subscribers have the last velocity."""
        self._velocities.wait_until_acknowledged()

    def problems(self) -> list[str]:
        """Returns what was missing when last observed, for people."""
        return [*self._problems, *(stop.problem for stop in self._stops if stop.problem)]

    def observed(self, now_ns: int) -> Surroundings:
        """Takes what has arrived; returns what it says. The preview's part is the gateway's to say."""
        if self._outranking and (message := newest(self._mux_output)):
            self._outranking.seen(velocity_of(message), now_ns)
        if odometry := newest(self._odometry):
            self._still = now_ns, is_still(velocity_of(odometry.twist))
        self._problems = self._takers.problems(now_ns)
        fresh = self._still is not None and now_ns - self._still[0] <= _ODOMETRY_NS
        return Surroundings(
            # All are asked, so that each takes what has arrived.
            robot_stopped=any([stop.active(now_ns) for stop in self._stops]),  # noqa: C419
            base_present=not self._problems,
            outranked=self._outranking.outranked(now_ns) if self._outranking else False,
            still=self._still[1] if self._still and fresh else None,
            sources_known=self._other_sources.known(
                now_ns, self._outranking.foreign_motion_ns if self._outranking else 0
            ),
            commanded_on=self._other_sources.commanding(now_ns),
        )


@contextmanager
def base(settings: DriveSettings) -> Iterator[Base]:
    """Yields the base; leaves the graph when the block ends.

    Raises:
        UserError: ROS 2 can't be used, or a message type is not installed.
    """
    with ros_node(OwnNode.DRIVE) as node:
        yield Base(node, settings)
