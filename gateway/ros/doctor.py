"""Examines ROS 2 on this machine: middleware, domain, message types, publishers."""

import os
import time
from collections.abc import Iterator, Sequence
from typing import Any, Final

from common.errors import UserError
from common.findings import Finding, good, note, wrong
from gateway.config import SourceSettings
from gateway.ros.lifetime import middleware_name, ros_node
from gateway.ros.publishers import publishers_of
from gateway.ros.readers import reader_for
from gateway.ros.subscription import TypeMissingError, message_class

DISCOVERY_S: Final = 3.0
"""Time limit for discovery; those of a running robot are usually found in a tenth of it."""
_POLL_EVERY_S: Final = 0.1


def ros_findings(sources: Sequence[SourceSettings]) -> Iterator[Finding]:
    """Yields the findings on the ROS 2 graph, without subscribing to anything."""
    yield from _environment()
    readable = []
    for source in sources:
        finding = _type_finding(source)
        yield finding
        if not finding.remedy:
            readable.append(source)
    try:
        with ros_node("robot_gateway_doctor") as node:
            yield good("ros", f"ROS 2 starts, with {middleware_name()}")
            found = _discover(node, readable)
    except UserError as error:
        yield wrong("ros", error.what, "Without ROS 2 no source can be read", error.remedy)
        return
    for source, publishers in found:
        yield _topic_finding(source, publishers)


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
        message_class(source.type)
    except TypeMissingError as error:
        package = source.type.partition("/")[0].replace("_", "-")
        return wrong(
            check,
            str(error),
            f"{source.name} can't be read",
            f"Install the package beside the gateway: apt install ros-$ROS_DISTRO-{package}",
        )
    except UserError as error:
        return wrong(check, error.what, f"{source.name} can't be read", error.remedy)
    return good(check, f"{source.type} is installed")


def _discover(node: Any, sources: Sequence[SourceSettings]) -> list[tuple[SourceSettings, list[Any]]]:
    """Returns the publishers of each source, once each has one or the time limit is reached."""
    until_s = time.monotonic() + DISCOVERY_S
    while True:
        found = [(source, list(node.get_publishers_info_by_topic(source.topic))) for source in sources]
        if all(publishers for _, publishers in found) or time.monotonic() >= until_s:
            return found
        # Polled: graph events need an executor that spins.
        time.sleep(_POLL_EVERY_S)


def _topic_finding(source: SourceSettings, publishers: list[Any]) -> Finding:
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
