"""geometry_msgs/msg/TwistStamped and Twist: velocity commands, into the robot's command mux and out of it."""

from typing import Any

from gateway.config import SourceSettings
from gateway.ros.readers.plain import all_finite
from gateway.ros.readers.registry import reads
from gateway.status.board import SourceKind
from gateway.status.values import Velocity


@reads("geometry_msgs/msg/TwistStamped", SourceKind.EFFECTIVE_COMMAND)
@reads("geometry_msgs/msg/TwistStamped", SourceKind.MUX_INPUT)
def from_twist_stamped(message: Any, source: SourceSettings) -> Velocity | None:
    """One command; what its stamp says is not read: the sender's clock may be wrong."""
    return from_twist(message.twist, source)


@reads("geometry_msgs/msg/Twist", SourceKind.EFFECTIVE_COMMAND)
@reads("geometry_msgs/msg/Twist", SourceKind.MUX_INPUT)
def from_twist(message: Any, source: SourceSettings) -> Velocity | None:
    """One command. None when a speed is not a finite number: no robot can follow it."""
    speeds = all_finite(message.linear.x, message.linear.y, message.angular.z)
    return Velocity(*speeds) if speeds else None
