"""The robot's base as the ROS 2 graph shows it, and the publisher of its velocities."""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

from rclpy.duration import Duration

from common.ros_node import OWN_NODES, OwnNode, message_class, ros_node
from drive.config import DriveSettings, Output
from drive.motion.values import MS, Surroundings, Velocity
from drive.ros.lock import Lock
from drive.ros.lock_topic import LockTopic
from drive.ros.other_sources import OtherSources
from drive.ros.outranking import Outranking
from drive.ros.stop_input import stop_inputs
from drive.ros.subscriptions import NEWEST, is_still, newest, subscribe, velocity_of
from drive.ros.takers import Takers

_ODOMETRY_NS: Final = 500 * MS
"""Older odometry says nothing about now."""
_ODOMETRY_EVERY_NS: Final = 100 * MS
"""It says when the robot has come to rest; to decode one takes longer than all other messages of a cycle."""
_MUX_OUTPUT_EVERY_NS: Final = 40 * MS
"""Another source is noticed after 300 ms (drive.ros.outranking); every second velocity is enough for that."""
_ACKNOWLEDGED_S: Final = 0.04
"""Within the guard's patience; on a robot an acknowledgement takes a millisecond."""


class _Output:
    """The publisher of one output. Its message is filled anew each time: to make one costs more than that."""

    def __init__(self, node: Any, output: Output) -> None:
        message_type = message_class(output.type)
        self._message = message_type()
        self.publisher = node.create_publisher(message_type, output.topic, NEWEST)
        self._header = self._message.header if output.type.endswith("Stamped") else None
        self._twist = self._message.twist if self._header else self._message
        if self._header:
            self._header.frame_id = output.frame_id

    def publish(self, velocity: Velocity, stamp: Any) -> None:
        """Publishes a velocity; the middleware has taken it when this returns."""
        if self._header:
            self._header.stamp = stamp
        twist = self._twist
        twist.linear.x = velocity.vx_mps
        twist.linear.y = velocity.vy_mps
        twist.angular.z = velocity.wz_rad_s
        self.publisher.publish(self._message)


class VelocityPublisher:
    """Publishes velocities. Used by the worker, and by the guard when the worker is gone.

    Args:
        node: of rclpy.
        outputs: inputs of the robot's multiplexer.
    """

    def __init__(self, node: Any, outputs: Sequence[Output]) -> None:
        self._clock = node.get_clock()
        self._outputs = [_Output(node, output) for output in outputs]

    def publish(self, velocity: Velocity) -> None:
        """Publishes a velocity on all outputs, stamped now: some controllers reject by the stamp's age."""
        stamp = self._clock.now().to_msg()
        for output in self._outputs:
            output.publish(velocity, stamp)

    def matched(self) -> int:
        """Returns how many subscriptions take the velocities, observers included."""
        return sum(output.publisher.get_subscription_count() for output in self._outputs)

    def wait_until_acknowledged(self) -> None:
        """Waits, for a moment, until reliable subscribers have the last velocity: before the process ends."""
        for output in self._outputs:
            output.publisher.wait_for_all_acked(Duration(seconds=_ACKNOWLEDGED_S))


class Base:
    """What the graph says about the base, and the publisher of its velocities.

    Args:
        node: of rclpy.
        settings: of the drive program.
        lock_left: whether an earlier process has left the lock active.
    """

    def __init__(self, node: Any, settings: DriveSettings, *, lock_left: bool) -> None:
        outputs = [output.topic for output in settings.outputs]
        mux_output = settings.mux_output.topic if settings.mux_output else None
        self._velocities = VelocityPublisher(node, settings.outputs)
        self._lock = (
            Lock(LockTopic(node, settings.lock_topic), time.monotonic_ns(), left=lock_left)
            if settings.lock_topic
            else None
        )
        self._takers = Takers(node, self._velocities, outputs, mux_output, OWN_NODES)
        self._outranking = Outranking() if settings.mux_output else None
        self._mux_output = (
            subscribe(node, settings.mux_output.type, settings.mux_output.topic)
            if settings.mux_output
            else None
        )
        self._odometry = (
            subscribe(node, "nav_msgs/msg/Odometry", settings.odometry) if settings.odometry else None
        )
        self._other_sources = OtherSources(node, outputs, mux_output)
        self._stops = stop_inputs(node, settings)
        self._problems: list[str] = []
        self._still: tuple[int, bool] | None = None
        self._odometry_due_ns = self._mux_output_due_ns = 0

    def publish(self, velocity: Velocity, now_ns: int) -> None:
        """Publishes a velocity, and remembers it for the comparison with what reaches the base."""
        self._velocities.publish(velocity)
        if self._outranking:
            self._outranking.published(velocity, now_ns)

    def lock(self, now_ns: int, *, active: bool) -> bool:
        """Locks or unlocks the multiplexer, where it can be and no other program may hold it.

        Returns:
            Whether that is decided; False where a release has to be requested again later.
        """
        return self._lock.publish(now_ns, active=active) if self._lock else True

    def lock_left(self) -> bool:
        """Returns whether the lock was published here, and is not known to be released since."""
        return self._lock is not None and self._lock.left

    def matched(self) -> int:
        """Returns how many subscriptions take the velocities, observers included."""
        return self._velocities.matched()

    def wait_until_acknowledged(self) -> None:
        """Waits, for a moment, until reliable subscribers have the last velocity."""
        self._velocities.wait_until_acknowledged()

    def problems(self) -> list[str]:
        """Returns what was missing when last observed, for people."""
        problems = [*self._problems, *(stop.problem for stop in self._stops)]
        return list(filter(None, [*problems, self._lock.problem if self._lock else ""]))

    def observed(self, now_ns: int) -> Surroundings:
        """Takes what has arrived; returns what it says. The preview's part is the gateway's to say."""
        self._take_mux_output(now_ns)
        self._take_odometry(now_ns)
        if self._lock:
            self._lock.observe(now_ns)
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

    def _take_mux_output(self, now_ns: int) -> None:
        if self._outranking is None or now_ns < self._mux_output_due_ns:
            return
        self._mux_output_due_ns = now_ns + _MUX_OUTPUT_EVERY_NS
        if message := newest(self._mux_output):
            self._outranking.seen(velocity_of(message), now_ns)

    def _take_odometry(self, now_ns: int) -> None:
        if now_ns < self._odometry_due_ns:
            return
        self._odometry_due_ns = now_ns + _ODOMETRY_EVERY_NS
        if odometry := newest(self._odometry):
            self._still = now_ns, is_still(velocity_of(odometry.twist))


@contextmanager
def base(settings: DriveSettings, *, lock_left: bool) -> Iterator[Base]:
    """Yields the base; leaves the graph when the block ends.

    Args:
        settings: of the drive program.
        lock_left: whether an earlier process has left the lock active.

    Raises:
        UserError: ROS 2 can't be used, or a message type is not installed.
    """
    with ros_node(OwnNode.DRIVE) as node:
        yield Base(node, settings, lock_left=lock_left)
