"""Programs in the ROS domain that break its rules: whatever they send, the gateway reads the others."""

from pathlib import Path
from typing import Any

import pytest
from rclpy.qos import QoSProfile
from std_msgs.msg import Header
from yolo_msgs.msg import DetectionArray

from common.healthcheck import state_of
from gateway.config import DEFAULT_SOURCES
from gateway.ros.doctor import ros_findings
from gateway.rpc.server import SERVICE
from omniseer.gateway.v1.source_pb2 import SOURCE_STATE_UNDECODABLE
from tests.support.gateway_program import GatewayProgram, gateway_program
from tests.support.helper import first_line, helper
from tests.support.ros import simulated_robot
from tests.support.talker import Talker
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]
SOURCES = {source.name: source for source in DEFAULT_SOURCES}


def active_faults(gateway: GatewayProgram) -> set[str]:
    return {fault.id for fault in gateway.status().faults if fault.active}


@pytest.mark.usefixtures("ros_domain")
def test_a_peer_whose_name_is_no_text_ends_nothing(tmp_path: Path) -> None:
    """Listing the publishers of its topic raises in rclpy; values, the other topics and health go on."""
    log = tmp_path / "gateway.log"
    with simulated_robot(tmp_path), gateway_program(tmp_path) as gateway:
        wait_until(lambda: gateway.status().health.ready, "a healthy robot")
        with helper("tests.support.undecodable_peer", SOURCES["odometry"].topic) as peer:
            assert first_line(peer) == "ready\n"
            wait_until(lambda: "can't be examined" in log.read_text(encoding="utf-8"), "the bad name")
            served = gateway.status().gateway.uptime_ms
            wait_until(lambda: gateway.status().gateway.uptime_ms > served + 3000, "three seconds more", 20)
            # A publisher that got no processor for a second is stale for a moment, whatever its peers are.
            wait_until(lambda: gateway.status().health.ready, "it is ready")
            wait_until(lambda: gateway.source("odometry").age_ms < 500, "odometry goes on")
            wait_until(lambda: gateway.source("vision").age_ms < 2000, "vision goes on")
            wait_until(lambda: active_faults(gateway) <= {"preview.unreachable"}, "no other fault lasts")
            assert state_of(f"127.0.0.1:{gateway.port}", SERVICE) == "SERVING"
            # The doctor looks until it has found one publisher, which may be the good one.
            wait_until(
                lambda: any("can't be listed" in each.what for each in ros_findings([SOURCES["odometry"]])),
                "the doctor's finding",
                30,
            )


@pytest.mark.usefixtures("ros_domain")
def test_messages_of_another_version_are_a_fault_that_says_so(tmp_path: Path, talker: Talker) -> None:
    """A package of the same name with other fields: the middleware connects both, and decoding fails."""
    topic = SOURCES["detections"].topic
    publisher: Any = talker.node.create_publisher(DetectionArray, topic, QoSProfile(depth=1))
    with gateway_program(tmp_path, faults={"startup_grace_ms": 0}) as gateway:
        wait_until(lambda: publisher.get_subscription_count() > 0, "the gateway's subscription")

        def sent_and_noticed() -> bool:
            # Little-endian CDR (XTypes 7.4.3.4) with a string longer than the message.
            publisher.publish(b"\x00\x01\x00\x00" + b"\xff" * 12)
            return bool(gateway.source("detections").state == SOURCE_STATE_UNDECODABLE)

        wait_until(sent_and_noticed, "messages that can't be decoded")
        assert "other fields" in gateway.source("detections").detail
        wait_until(lambda: "detections.undecodable" in active_faults(gateway), "the fault")
        wait_until(
            lambda: (
                publisher.publish(DetectionArray(header=Header()))
                or "detections.undecodable" not in active_faults(gateway)
            ),
            "the fault to clear once messages can be decoded",
            30,
        )
