"""The subscription of a configured source: its message class and its QoS profile."""

from importlib import import_module
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from gateway.config import SourceSettings


class TypeMissingError(Exception):
    """A message type is not installed; the text names the package to install."""


def message_class(type_name: str) -> Any:
    """Returns the Python class of "package/msg/Name".

    Raises:
        TypeMissingError: the package is not installed, or has no such message.
    """
    package, _, name = type_name.split("/")
    try:
        return getattr(import_module(f"{package}.msg"), name)
    except ImportError as error:
        raise TypeMissingError(
            f"message type {type_name} is not installed ({error}); install the ROS package {package}"
        ) from error
    except AttributeError as error:
        raise TypeMissingError(f"the installed package {package} has no message {name}") from error


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
