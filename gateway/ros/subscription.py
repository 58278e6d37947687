"""The subscription of a configured source: its message class and its QoS profile."""

from typing import Any

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from common.ros_node import message_class, subscribe_raw
from gateway.config import SourceSettings
from gateway.ros.field_types import check_field


def subscribe(node: Any, source: SourceSettings) -> Any:
    """Returns a subscription for serialised messages. No executor spins it: `Source` takes the messages.

    Raises:
        TypeMissingError: see `message_class` and `subscribe_raw`.
        FieldMissingError: see `check_field`.
    """
    message_type = message_class(source.type)
    check_field(message_type, source)
    return subscribe_raw(node, message_type, source.topic, qos_of(source))


def qos_of(source: SourceSettings) -> Any:
    """Returns the QoS profile of the settings; when the history is full, the oldest message is dropped."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=source.spec.queue_depth,
        reliability=ReliabilityPolicy[source.reliability.upper()],
        durability=DurabilityPolicy[source.durability.upper()],
    )
