"""Subscriptions that nothing spins: the worker takes the newest messages in its own cycle."""

import logging
from typing import Any, Final

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from common.ros_node import message_class
from drive.motion.values import Velocity

_log = logging.getLogger(__name__)

NEWEST: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
BEST_EFFORT: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=1, reliability=ReliabilityPolicy.BEST_EFFORT
)
"""Matches publishers of either reliability."""
_STILL_MPS: Final = 0.02
_STILL_RAD_S: Final = 0.05


def subscribe(node: Any, type_name: str, topic: str, qos: QoSProfile = BEST_EFFORT) -> Any:
    """Returns a subscription whose messages `newest` takes."""
    return node.create_subscription(message_class(type_name), topic, _never_called, qos)


def newest(subscription: Any) -> Any | None:
    """Returns the newest message, None if there is no new one. One that can't be decoded is none."""
    if subscription is None:
        return None
    try:
        taken = subscription.handle.take_message(subscription.msg_type, False)
    except Exception as error:  # noqa: BLE001  # whatever a publisher sends must not end the cycle
        _log.warning("%s: a message can't be read: %s", subscription.topic_name, error)
        return None
    return taken[0] if taken else None


def velocity_of(message: Any) -> Velocity:
    """Returns the velocity of a Twist, or of a message that has one (TwistStamped, TwistWithCovariance)."""
    twist = getattr(message, "twist", message)
    return Velocity(twist.linear.x, twist.linear.y, twist.angular.z)


def is_still(velocity: Velocity) -> bool:
    """Whether a measured velocity is that of a robot that stands still; NaN is not."""
    linear_mps = abs(velocity.vx_mps) + abs(velocity.vy_mps)
    return linear_mps <= _STILL_MPS and abs(velocity.wz_rad_s) <= _STILL_RAD_S


def _never_called(_message: Any) -> None:
    raise AssertionError("no executor spins these subscriptions")
