"""nav_msgs/msg/Odometry: only the twist is read; it is in the robot's own frame (child_frame_id)."""

from typing import Any

from gateway.config import SourceSettings
from gateway.ros.readers.plain import all_finite
from gateway.ros.readers.registry import reads
from gateway.status.board import SourceKind
from gateway.status.values import Odometry


@reads("nav_msgs/msg/Odometry", SourceKind.ODOMETRY)
def from_odometry(message: Any, source: SourceSettings) -> Odometry | None:
    """How the robot moves. None when a speed is not a finite number: the filter has lost itself."""
    twist = message.twist.twist
    return planar(twist.linear.x, twist.linear.y, twist.angular.z)


def planar(vx_mps: Any, vy_mps: Any, wz_rad_s: Any) -> Odometry | None:
    """A value out of three speeds, for readers of other types, too. None when one of them is not finite."""
    speeds = all_finite(vx_mps, vy_mps, wz_rad_s)
    return Odometry(*speeds) if speeds else None
