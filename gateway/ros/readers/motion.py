"""Velocities: nav_msgs/msg/Odometry, geometry_msgs/msg/TwistStamped and Twist. m/s and rad/s (REP-103)."""

from typing import Any

from gateway.config import SourceSettings
from gateway.ros.readers.plain import all_finite
from gateway.ros.readers.registry import reads
from gateway.status.sources import EFFECTIVE_COMMAND, MUX_INPUTS, ODOMETRY
from gateway.status.values import Velocity

_COMMANDS = (EFFECTIVE_COMMAND, *MUX_INPUTS.values())


@reads("nav_msgs/msg/Odometry", ODOMETRY)
def from_odometry(message: Any, source: SourceSettings) -> Velocity | None:
    """Returns the twist, which is in the body frame (child_frame_id); None if it is not finite.

    A filter that has diverged publishes NaN.
    """
    return from_twist(message.twist.twist, source)


@reads("geometry_msgs/msg/TwistStamped", *_COMMANDS)
def from_twist_stamped(message: Any, source: SourceSettings) -> Velocity | None:
    """Returns the command. Its stamp is ignored: the sender's clock may be wrong."""
    return from_twist(message.twist, source)


@reads("geometry_msgs/msg/Twist", *_COMMANDS)
def from_twist(message: Any, _source: SourceSettings) -> Velocity | None:
    """Returns the command; None if it is not finite: no robot can follow it."""
    velocity = all_finite(message.linear.x, message.linear.y, message.angular.z)
    return Velocity(*velocity) if velocity else None
