"""A configured source becomes a subscription: its message class, its quality of service."""

from importlib import import_module
from typing import Any, Final

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from gateway.config import SourceSettings
from gateway.status.board import SourceKind

# Only the newest message is ever wanted: DDS drops older ones before Python sees them, so a topic that gets
# faster costs next to nothing, and one read per pass empties the queue.
_DEPTH: Final = 1
# Diagnostics are the exception: many programs publish on that one topic, each of its own components.
_DIAGNOSTICS_DEPTH: Final = 64


class TypeMissingError(Exception):
    """A message type that is not installed here; the text says what to install."""


def message_class(type_name: str) -> Any:
    """The Python class of "package/msg/Name".

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
    """A subscription that hands out raw bytes. Nobody spins it: it is emptied by hand.

    Raises:
        TypeMissingError: see `message_class`; also when the type's middleware support can't be loaded.
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
    """The quality of service that the settings ask for."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth_of(source),
        reliability=ReliabilityPolicy[source.reliability.upper()],
        durability=DurabilityPolicy[source.durability.upper()],
    )


def depth_of(source: SourceSettings) -> int:
    """How many messages may wait for the next look; when there are more, the oldest are dropped."""
    return _DIAGNOSTICS_DEPTH if source.kind is SourceKind.DIAGNOSTICS else _DEPTH


def _never_called(message: Any) -> None:
    raise AssertionError("nobody spins these subscriptions")
