"""Examines ROS 2 on this machine: middleware, domain, message types, publishers."""

import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

from rclpy.expand_topic_name import expand_topic_name

from common.errors import UserError
from common.findings import Finding, Verdict, good, note, wrong
from common.ros_node import (
    OwnNode,
    TypeMissingError,
    message_class,
    middleware_name,
    ros_node,
    share_directory,
)
from common.ros_transport_findings import transport_finding
from common.start_command import messages_remedy
from gateway.config import SourceSettings
from gateway.ros.field_types import FieldMissingError, check_field
from gateway.ros.publishers import publishers_of
from gateway.ros.readers import reader_for

_STAND_IN: Final = "STAND_IN"
"""The file that marks the packages of interfaces/stand_ins."""
DISCOVERY_S: Final = 3.0
"""Time limit for discovery; those of a running robot are usually found in a tenth of it."""
_POLL_EVERY_S: Final = 0.1


@dataclass(frozen=True, slots=True)
class _Announced:
    """The publishers of a topic, or why they can't be listed."""

    publishers: Sequence[Any] = ()
    problem: str = ""


def ros_findings(sources: Sequence[SourceSettings]) -> Iterator[Finding]:
    """Yields the findings on the ROS 2 graph, without subscribing to anything."""
    yield from _environment()
    # Before a node is made, which may set variables for itself.
    yield from transport_finding(middleware_name())
    readable = []
    for source in sources:
        finding = _type_finding(source)
        yield finding
        if finding.verdict is not Verdict.WRONG:
            readable.append(source)
    try:
        with ros_node(OwnNode.GATEWAY_DOCTOR) as node:
            yield good("ros", f"ROS 2 starts, with {middleware_name()}")
            found = _discover(node, readable)
    except UserError as error:
        yield wrong("ros", error.what, "Without ROS 2 no source can be read", error.remedy)
        return
    for source, announced in found:
        if announced.problem:
            yield wrong(
                f"topic.{source.name}",
                f"the publishers of {source.topic} can't be listed: {announced.problem}",
                "A program in this ROS domain announces itself with a name that is no text",
                "Set ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST, so that other machines are left out",
            )
        else:
            yield _topic_finding(source, announced.publishers)


def _environment() -> Iterator[Finding]:
    domain = os.environ.get("ROS_DOMAIN_ID", "").strip() or "0"
    yield good("ros.domain", f"ROS_DOMAIN_ID is {domain}; the robot's programs must have the same")
    reach = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").strip().upper() or "SUBNET"
    if reach == "OFF":
        yield wrong(
            "ros.discovery",
            "ROS_AUTOMATIC_DISCOVERY_RANGE is OFF",
            "Publishers are not discovered",
            "Unset it, or set it to LOCALHOST or SUBNET",
        )


def _type_finding(source: SourceSettings) -> Finding:
    check = f"type.{source.name}"
    try:
        reader_for(source)
        installed = message_class(source.type)
        check_field(installed, source)
    except TypeMissingError as error:
        package = source.type.partition("/")[0].replace("_", "-")
        return wrong(
            check,
            str(error),
            f"{source.name} can't be read",
            f"Install the package beside the gateway: apt install ros-$ROS_DISTRO-{package}",
        )
    except FieldMissingError as error:
        return wrong(
            check,
            str(error),
            f"{source.name} can't be read",
            f"Correct field or type; to list the fields, type: ros2 interface show {source.type}",
        )
    except UserError as error:
        return wrong(check, error.what, f"{source.name} can't be read", error.remedy)
    if _is_stand_in(installed):
        return note(
            check,
            f"{source.type} is this project's stand-in, for machines without the real package",
            "Messages of the real package can't be decoded with it",
            messages_remedy(),
        )
    return good(check, f"{source.type} is installed")


def _is_stand_in(message_type: Any) -> bool:
    """Returns whether the class comes from a package of interfaces/stand_ins."""
    share = share_directory(message_type.__module__.partition(".")[0])
    return share is not None and (share / _STAND_IN).exists()


def _discover(node: Any, sources: Sequence[SourceSettings]) -> list[tuple[SourceSettings, _Announced]]:
    """Returns what is announced for each source, once each has a publisher or a problem, or time is up."""
    until_s = time.monotonic() + DISCOVERY_S
    while True:
        found = [(source, _publishers(node, _full_name(source.topic))) for source in sources]
        if all(each.publishers or each.problem for _, each in found) or time.monotonic() >= until_s:
            return found
        # Polled: graph events need an executor that spins.
        time.sleep(_POLL_EVERY_S)


def _full_name(topic: str) -> str:
    """Returns the name that the gateway's node subscribes to: ~ is its own name, not the doctor's."""
    return str(expand_topic_name(topic, OwnNode.GATEWAY, "/"))


def _publishers(node: Any, topic: str) -> _Announced:
    try:
        return _Announced(node.get_publishers_info_by_topic(topic))
    except (RuntimeError, UnicodeError) as error:
        return _Announced(problem=str(error) or type(error).__name__)


def _topic_finding(source: SourceSettings, publishers: Sequence[Any]) -> Finding:
    check = f"topic.{source.name}"
    if not publishers:
        report = wrong if source.required else note
        return report(
            check,
            f"nothing publishes {source.topic}",
            f"{source.name} can't be received",
            "Start the program that publishes it, in the same domain; to check, type: ros2 topic list",
        )
    verdict = publishers_of(source, publishers)
    if verdict.wrong_type:
        types = sorted({each.topic_type for each in publishers})
        return wrong(
            check,
            f"{source.topic} is published as {', '.join(types)}, but configured as {source.type}",
            f"{source.name} can't be received",
            f"Set the type of this source to {types[0]}",
        )
    if verdict.qos_mismatch:
        return wrong(
            check,
            f"{source.topic} is published with an incompatible QoS: {verdict.qos_mismatch}",
            "The middleware does not connect the two: nothing arrives",
            "Set reliability to best_effort and durability to volatile for this source: they fit all",
        )
    return good(check, f"{source.topic}: {len(publishers)} publishing")
