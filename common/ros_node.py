"""A program's node in the ROS 2 graph, exactly as long as a `with` block, and message types by name.

Domain, middleware and discovery range come from the environment (ROS_DOMAIN_ID, RMW_IMPLEMENTATION,
ROS_AUTOMATIC_DISCOVERY_RANGE), as everywhere in ROS 2. The process is left alone: own context, no signal
handlers, no log files, none of the services of an ordinary node.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from common.errors import UserError
from common.ros_environment import check_domain
from common.ros_transport import chosen_transport

# Programs import this module before others that need rclpy, so that its absence ends in this error.
try:
    from rclpy.context import Context
    from rclpy.event_handler import SubscriptionEventCallbacks
    from rclpy.node import Node
    from rclpy.parameter import Parameter
    from rclpy.utilities import get_rmw_implementation_identifier
except ImportError as error:
    raise UserError(
        f"ROS 2 can't be used from Python ({error})",
        "Type: scripts/setup, or source the setup.bash of a ROS 2 installation first",
    ) from error


class OwnNode(StrEnum):
    """The nodes of this project's programs. They may take velocities to look at them; none moves by them."""

    GATEWAY = "robot_gateway"
    GATEWAY_DOCTOR = "robot_gateway_doctor"
    DRIVE = "robot_drive"
    DRIVE_GUARD = "robot_drive_guard"
    DRIVE_DOCTOR = "robot_drive_doctor"
    DRIVE_PULSE = "robot_drive_pulse"
    RECORDER = "robot_recorder"
    TAP = "robot_camera_tap"
    TAP_DOCTOR = "robot_tap_doctor"


OWN_NODES: Final = frozenset(OwnNode)


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


def share_directory(package: str) -> Path | None:
    """Returns where an installed package of messages keeps its files; None if there is no such package.

    Nothing is imported: the name may come from the graph.
    """
    try:
        spec = find_spec(package)
    except (ImportError, ValueError):
        return None
    # PREFIX/lib/pythonX.Y/site-packages/PACKAGE/__init__.py, as colcon and the wheels install it.
    file = Path(spec.origin) if spec and spec.origin else Path()
    share = file.parents[4] / "share" / package if len(file.parents) > 4 else None
    return share if share and share.is_dir() else None


def subscribe_raw(node: Any, message_type: Any, topic: str, qos: Any) -> Any:
    """Returns a subscription for serialised messages. No executor spins it: its owner takes the messages.

    Raises:
        TypeMissingError: the type support of the middleware can't be loaded.
    """
    try:
        return node.create_subscription(
            message_type,
            topic,
            _never_called,
            qos,
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )
    except (RuntimeError, ImportError) as error:
        raise TypeMissingError(f"{topic} can't be subscribed: {error}") from error


def _never_called(_message: Any) -> None:
    raise AssertionError("no executor spins these subscriptions")


def middleware_name() -> str:
    """Returns the name of the middleware in use: "rmw_fastrtps_cpp" for example."""
    return str(get_rmw_implementation_identifier())


@contextmanager
def ros_node(name: str, *, parameters: bool = False) -> Iterator[Any]:
    """Yields a node without services and rosout; it leaves the graph when the block ends.

    Args:
        name: of the node.
        parameters: whether others may ask for its parameters, by the usual services.

    Raises:
        UserError: the environment names an impossible domain, or the middleware can't start.
    """
    check_domain()
    with chosen_transport(), _started_context() as context:
        node = Node(
            name,
            context=context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=parameters,
            parameter_overrides=[Parameter("start_type_description_service", value=False)],
        )
        try:
            yield node
        finally:
            node.destroy_node()


@contextmanager
def readable_names() -> Iterator[None]:
    """Turns what rclpy makes of a name in the graph that is no text into an error for people.

    rcl refuses such names, but a participant of another vendor, or an attacker's, may announce one.

    Raises:
        UserError: while the block asked for such a name.
    """
    try:
        yield
    except UnicodeDecodeError as error:
        raise UserError(
            "the graph can't be listed: a program in this ROS domain announces itself with a name that is no "
            f"text ({error})",
            "Set ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST, so that other machines are left out",
        ) from error


@contextmanager
def _started_context() -> Iterator[Context]:
    context = Context()
    try:
        context.init(args=[], initialize_logging=False)
    except RuntimeError as error:
        raise UserError(
            f"ROS 2 can't start: {error}", "Check ROS_DOMAIN_ID and RMW_IMPLEMENTATION in the environment"
        ) from error
    try:
        yield context
    finally:
        context.shutdown()
        context.destroy()
