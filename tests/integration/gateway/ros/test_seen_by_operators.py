"""The whole gateway as a process beside a robot's processes: what operators see is what is."""

import signal
import struct
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from omniseer_msgs.msg import VisionPerfSummary
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import BatteryState
from std_msgs.msg import String
from yolo_msgs.msg import DetectionArray

from gateway.config import DEFAULT_SOURCES
from gateway.rpc.responses.response_cache import REUSE_S
from omniseer.gateway.v1 import fault_pb2, source_pb2
from tests.support.gateway_program import GatewayProgram, gateway_program
from tests.support.ros import simulated_robot
from tests.support.talker import Talker
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.timeout(180)]

TOPICS = {source.name: source.topic for source in DEFAULT_SOURCES}
TYPES = {
    "odometry": Odometry,
    "vision": VisionPerfSummary,
    "battery": BatteryState,
    "detections": DetectionArray,
    "effective_command": TwistStamped,
}


class PlainSubscriber:
    """What an ordinary rclpy node hears, in the ordinary way: callbacks on an executor."""

    def __init__(self, node: Any) -> None:
        self.heard: dict[str, list[Any]] = {name: [] for name in TYPES}
        qos = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
        for name, message_type in TYPES.items():
            node.create_subscription(message_type, TOPICS[name], self.heard[name].append, qos)

    def last(self, name: str) -> Any:
        return self.heard[name][-1]


@contextmanager
def plain_subscriber(talker: Talker) -> Iterator[PlainSubscriber]:
    subscriber = PlainSubscriber(talker.node)
    executor = SingleThreadedExecutor(context=talker.node.context)
    executor.add_node(talker.node)
    over = threading.Event()

    def spin() -> None:
        while not over.is_set():
            executor.spin_once(timeout_sec=0.1)

    thread = threading.Thread(target=spin)
    thread.start()
    try:
        yield subscriber
    finally:
        over.set()
        thread.join()
        executor.shutdown()


def test_what_a_plain_subscriber_saw_last_is_what_is_served(talker: Talker, tmp_path: Path) -> None:
    with (
        simulated_robot(tmp_path, "speed_mps=0.7", "turn_rad_s=-0.3", "detection_count=5") as robot,
        gateway_program(tmp_path) as gateway,
        plain_subscriber(talker) as plain,
    ):
        wait_until(lambda: all(plain.heard.values()), "the plain subscriber to hear everything")
        wait_until(
            lambda: all(gateway.source(name).available for name in TYPES), "the gateway to hear everything"
        )

        def heard_more_than(counts: dict[str, int], speed: float) -> bool:
            # What was still to be read then has the speed of before.
            renewed = plain.last("odometry").twist.twist.linear.x == speed
            return renewed and all(len(plain.heard[name]) > counts[name] for name in TYPES)

        for speed in (0.25, -0.5, 0.75):
            robot.change(speed_mps=speed, silent=[])
            counts = {name: len(heard) for name, heard in plain.heard.items()}
            wait_until(partial(heard_more_than, counts, speed), "new messages of everything")
            robot.change(silent=["odometry", "vision", "battery", "detections", "effective_command"])
            wait_until(lambda: gateway.source("odometry").stale, "silence")
            # Either may have yet to read what was the last before it.
            wait_until(lambda: agrees(gateway.overlay(), plain), "the same last messages of everything")
            overlay = gateway.overlay()
            for status in (gateway.status(), overlay.status):
                is_what_was_heard(status, plain)
            assert plain.last("odometry").twist.twist.linear.x == speed
            has_the_objects_that_were_heard(overlay, plain)


def agrees(overlay: Any, plain: PlainSubscriber) -> bool:
    """Whether all that the two have is the same."""
    try:
        is_what_was_heard(overlay.status, plain)
        has_the_objects_that_were_heard(overlay, plain)
    except AssertionError:
        return False
    return True


def has_the_objects_that_were_heard(overlay: Any, plain: PlainSubscriber) -> None:
    """The detections of an overlay are those of the last message."""
    assert [
        (each.track_id, each.class_name, each.bbox_center_x_px, each.bbox_width_px)
        for each in overlay.detections.detections
    ] == [
        (each.id, each.class_name, single(each.bbox.center.position.x), single(each.bbox.size.x))
        for each in plain.last("detections").detections
    ]


def is_what_was_heard(status: Any, plain: PlainSubscriber) -> None:
    """The values of a status are those of the last messages; silence keeps both as they are."""
    twist = plain.last("odometry").twist.twist
    health = status.health
    assert (health.measured_vx_mps, health.measured_vy_mps, health.measured_wz_rad_s) == (
        single(twist.linear.x),
        single(twist.linear.y),
        single(twist.angular.z),
    )
    vision, perf = status.vision, plain.last("vision")
    assert (vision.producer_fps, vision.consumer_fps, vision.last_infer_ms) == (
        perf.producer_fps,
        perf.consumer_fps,
        perf.last_infer_ms,
    )
    assert vision.infer_error_count == perf.infer_error_count
    assert vision.capture_fatal_error_count == perf.capture_fatal_error_count
    lipo = status.platform.power.lipo_battery
    assert lipo.voltage == plain.last("battery").voltage
    assert lipo.percentage == pytest.approx(100 * plain.last("battery").percentage)
    command, seen = plain.last("effective_command").twist, status.effective_command
    assert (seen.vx_mps, seen.vy_mps, seen.wz_rad_s) == (
        single(command.linear.x),
        single(command.linear.y),
        single(command.angular.z),
    )


MODE = {
    "kind": "mode",
    "topic": "/mission/mode",
    "type": "std_msgs/msg/String",
    "stale_after_ms": 60_000,
    "reliability": "reliable",
    "durability": "transient_local",
}


def test_the_mode_and_the_components_a_plain_subscriber_heard_are_served(
    talker: Talker, tmp_path: Path
) -> None:
    """What arrives as a fault or a word instead of a number, in both answers."""
    heard: dict[str, Any] = {}
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    talker.node.create_subscription(String, MODE["topic"], lambda it: heard.update(mode=it.data), latched)
    talker.node.create_subscription(
        DiagnosticArray, TOPICS["diagnostics"], lambda it: heard.update(components=it.status), 10
    )
    sources = [*(each.model_dump(mode="json", exclude_none=True) for each in DEFAULT_SOURCES), MODE]

    def was_heard(mode: str, levels: dict[str, str]) -> bool:
        return (
            heard.get("mode") == mode
            and "components" in heard
            and len(in_trouble(heard["components"])) == len(levels)
        )

    def serves_what_was_heard(answer: Callable[[], Any]) -> bool:
        status = answer()
        return bool(
            status.mission.mode == heard["mode"]
            and component_faults(status) == in_trouble(heard["components"])
        )

    with (
        simulated_robot(tmp_path, "--diagnostics-hz", "20") as robot,
        gateway_program(tmp_path, sources=sources, faults={"clear_after_ms": 100}) as gateway,
        plain_subscriber(talker),
    ):
        for mode, levels in (
            ("docking", {"drive": "error", "lidar": "stale"}),
            ("exploring", {"lidar": "error"}),
            ("idle", {}),
        ):
            robot.change(mode=mode, components=levels)
            wait_until(partial(was_heard, mode, levels), f"the plain subscriber to hear {mode} and {levels}")
            for answer in (gateway.status, lambda: gateway.overlay().status):
                wait_until(
                    partial(serves_what_was_heard, answer),
                    f"{heard['mode']} and {in_trouble(heard['components'])} to be served",
                )


def in_trouble(components: Any) -> set[tuple[str, int]]:
    """Words and severity of every component that a message calls wrong."""
    severities = {
        DiagnosticStatus.ERROR: fault_pb2.FAULT_SEVERITY_ERROR,
        DiagnosticStatus.STALE: fault_pb2.FAULT_SEVERITY_WARNING,
    }
    return {(each.message, severities[each.level]) for each in components if each.level in severities}


def component_faults(status: Any) -> set[tuple[str, int]]:
    """The same of the faults that are served: a fault's words end with the component's own."""
    return {
        (fault.message.rpartition(": ")[2], fault.severity)
        for fault in status.faults
        if fault.active and fault.id.startswith("diagnostics.")
    }


def single(number: float) -> float:
    """As a 32-bit float holds it."""
    return float(struct.unpack("f", struct.pack("f", number))[0])


def test_a_mismatch_is_reported_in_words_without_ros_names(talker: Talker, tmp_path: Path) -> None:
    sources = [
        {
            **source.model_dump(mode="json", exclude_none=True),
            "reliability": "reliable",
            "required": source.name == "odometry",
        }
        for source in DEFAULT_SOURCES
        if source.name in {"odometry", "battery"}
    ]
    talker.publisher(TOPICS["odometry"], Odometry, reliability=ReliabilityPolicy.BEST_EFFORT)
    talker.publisher(TOPICS["battery"], Odometry)
    with gateway_program(tmp_path, sources=sources, faults={"startup_grace_ms": 0}) as gateway:
        wait_until(
            lambda: gateway.source("odometry").state == source_pb2.SOURCE_STATE_QOS_MISMATCH, "the mismatch"
        )
        wait_until(
            lambda: gateway.source("battery").state == source_pb2.SOURCE_STATE_WRONG_TYPE, "the wrong type"
        )
        detail = gateway.source("odometry").detail
        assert "reliable is requested, best effort is offered" in detail
        wait_until(
            lambda: (
                {"odometry.qos_mismatch", "battery.wrong_type"} <= {it.id for it in gateway.status().faults}
            ),
            "both faults",
        )
        assert not [name for name in TOPICS.values() if name in str(gateway.overlay())]
        log = (tmp_path / "gateway.log").read_text(encoding="utf-8")
        assert TOPICS["odometry"] in log, "the topic is named for those who look after the robot"


@pytest.mark.usefixtures("ros_domain")
def test_a_stopped_robot_is_stale_and_its_late_burst_is_new(tmp_path: Path) -> None:
    """Stopped as a debugger would: the publishers stay, nothing comes; then everything goes on."""
    with gateway_program(tmp_path) as gateway, simulated_robot(tmp_path) as robot:
        wait_until(lambda: gateway.status().health.ready, "a healthy robot")
        with stopped(robot.process):
            wait_until(lambda: gateway.source("odometry").stale, "staleness")
            status = gateway.status()
            assert status.health.summary == "odometry stale"
            assert gateway.source("odometry").detail == "odometry stopped coming"
            first = status.health.odom_age_ms
            wait_until(lambda: gateway.status().health.odom_age_ms > first + 500, "the age to go on")
        wait_until(lambda: gateway.status().health.ready, "a healthy robot again")


@contextmanager
def stopped(process: subprocess.Popen[str]) -> Iterator[None]:
    process.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        process.send_signal(signal.SIGCONT)


@pytest.mark.usefixtures("ros_domain")
def test_ages_grow_with_the_clock_while_nothing_comes(tmp_path: Path) -> None:
    with gateway_program(tmp_path) as gateway, simulated_robot(tmp_path) as robot:
        wait_until(lambda: gateway.status().health.ready, "a healthy robot")
        robot.change(silent=["odometry"])
        wait_until(lambda: gateway.source("odometry").stale, "silence")
        first_from_s, first_ms, first_until_s = age_between(gateway)
        wait_until(lambda: gateway.status().health.odom_age_ms > first_ms + 1000, "a second more")
        last_from_s, last_ms, last_until_s = age_between(gateway)
        grown_ms = last_ms - first_ms
        # However long the answers take: an age is as old as its response is reused for, and cut.
        assert grown_ms >= 1000 * (last_from_s - first_until_s - REUSE_S) - 1
        assert grown_ms <= 1000 * (last_until_s - first_from_s + REUSE_S) + 1


def age_between(gateway: GatewayProgram) -> tuple[float, int, float]:
    """The age of odometry in milliseconds, and before and after it the seconds of the clock."""
    before_s = time.monotonic()
    age_ms = gateway.status().health.odom_age_ms
    return before_s, age_ms, time.monotonic()
