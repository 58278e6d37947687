"""The subscription of a configured source: its message class and its QoS profile."""

from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from common.ros_node import TypeMissingError, message_class
from gateway.config import SourceSettings


def subscribe(node: Any, source: SourceSettings) -> Any:
    """Returns a subscription for serialised messages. No executor spins it: `Source` takes the messages.

    Raises:
        TypeMissingError: see `message_class`; also if the type support of the middleware can't be loaded.
    """
    message_type = message_class(source.type)
    try:
        return node.create_subscription(
            message_type,
            source.topic,
            _never_called,
            qos_of(source),
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )
    except (RuntimeError, ImportError) as error:
        raise TypeMissingError(f"{source.topic} can't be subscribed as {source.type}: {error}") from error


def qos_of(source: SourceSettings) -> Any:
    """Returns the QoS profile of the settings; when the history is full, the oldest message is dropped."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=source.spec.queue_depth,
        reliability=ReliabilityPolicy[source.reliability.upper()],
        durability=DurabilityPolicy[source.durability.upper()],
    )


def _never_called(_message: Any) -> None:
    raise AssertionError("no executor spins these subscriptions")
