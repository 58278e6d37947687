"""Real rclpy on both sides: what is published is what the board holds."""

import math
from functools import partial
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry as OdometryMessage
from omniseer_msgs.msg import VisionPerfSummary
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.serialization import serialize_message
from sensor_msgs.msg import BatteryState
from vision_msgs.msg import Detection2D, Detection2DArray, ObjectHypothesis, ObjectHypothesisWithPose
from yolo_msgs.msg import Detection as YoloDetection
from yolo_msgs.msg import DetectionArray

from gateway.config import DEFAULT_SOURCES, SourceSettings
from gateway.ros.intake import intake
from gateway.ros.readers import registry
from gateway.status.board import Board
from gateway.status.sources import BATTERY, DETECTIONS, ODOMETRY, VISION
from gateway.status.values import Battery, Detection, Velocity, Vision
from tests.support.boards import has_all, newest
from tests.support.talker import Talker, talking
from tests.support.waiting import wait_until

pytestmark = pytest.mark.ros


def driving(vx: float, vy: float = 0.0, wz: float = 0.0) -> Any:
    message = OdometryMessage()
    message.twist.twist.linear.x, message.twist.twist.linear.y = vx, vy
    message.twist.twist.angular.z = wz
    return message


def test_every_default_source_arrives(talker: Talker) -> None:
    board = Board()
    with intake(DEFAULT_SOURCES, board) as running:
        talker.say(running, "/odometry/filtered", driving(0.5, -0.25, 0.125))
        talker.say(
            running,
            "/vision/perf",
            VisionPerfSummary(
                producer_fps=30.0,
                consumer_fps=29.5,
                last_infer_ms=18.25,
                infer_error_count=2**64 - 1,
                capture_fatal_error_count=3,
            ),
        )
        detection = YoloDetection(class_id=2, class_name="car", score=0.5, id="9")
        detection.bbox.center.position.x, detection.bbox.center.position.y = 640.0, 360.0
        detection.bbox.size.x, detection.bbox.size.y = 100.0, 50.0
        talker.say(running, "/yolo/detections", DetectionArray(detections=[detection]))
        talker.say(
            running,
            "/battery",
            BatteryState(present=True, voltage=15.5, percentage=0.75, power_supply_status=2),
        )
        wait_until(lambda: has_all(board, ODOMETRY, VISION, DETECTIONS, BATTERY), "all values")
    assert newest(board, ODOMETRY).value == Velocity(0.5, -0.25, 0.125)
    assert newest(board, VISION).value == Vision(30.0, 29.5, 18.25, 2**64 - 1, 3)
    assert newest(board, DETECTIONS).value.items == (Detection(2, "car", 0.5, "9", 640, 360, 100, 50),)
    assert newest(board, BATTERY).value == Battery(True, 15.5, 75.0, False)


def test_the_other_type_of_detections(talker: Talker) -> None:
    board = Board()
    source = SourceSettings(
        kind="detections",
        topic="/boxes",
        type="vision_msgs/msg/Detection2DArray",
        stale_after_ms=500,
    )
    hypothesis = ObjectHypothesisWithPose(hypothesis=ObjectHypothesis(class_id="dog", score=0.5))
    detection = Detection2D(results=[hypothesis], id="4")
    detection.bbox.center.position.x, detection.bbox.size_x, detection.bbox.size_y = 10.0, 20.0, 30.0
    with intake([source], board) as running:
        talker.say(running, "/boxes", Detection2DArray(detections=[detection]))
        found = wait_until(lambda: board[DETECTIONS], "detections")
    assert found.value.items == (Detection(0, "dog", 0.5, "4", 10, 0, 20, 30),)


def test_speeds_that_are_no_numbers_leave_the_last_good_value(talker: Talker) -> None:
    board = Board()
    with intake(DEFAULT_SOURCES, board) as running:
        odometry = running.sources["odometry"]
        talker.say(running, "/odometry/filtered", driving(0.5))
        good = wait_until(lambda: board[ODOMETRY], "the good value")

        def without_value(count: int) -> bool:
            return odometry.counts.without_value == count

        for number, bad in enumerate((math.nan, math.inf, -math.inf), start=1):
            talker.say(running, "/odometry/filtered", driving(bad))
            wait_until(partial(without_value, number), "the bad one to be read")
        assert board[ODOMETRY] is good


def test_ten_thousand_detections_are_capped_and_counted(talker: Talker) -> None:
    board = Board()
    with intake(DEFAULT_SOURCES, board) as running:
        many = [YoloDetection(id=str(number)) for number in range(10_000)]
        talker.say(running, "/yolo/detections", DetectionArray(detections=many))
        found = wait_until(lambda: board[DETECTIONS], "detections")
        assert found.value.count == 10_000
        assert [item.track_id for item in found.value.items] == [str(number) for number in range(100)]
        talker.say(running, "/yolo/detections", DetectionArray())
        wait_until(lambda: newest(board, DETECTIONS).value.count == 0, "the empty frame")


def test_a_name_that_is_not_utf8_is_shown_all_the_same(talker: Talker) -> None:
    board = Board()
    with intake(DEFAULT_SOURCES, board) as running:
        raw = serialize_message(DetectionArray(detections=[YoloDetection(class_name="XXXX")]))
        publisher = talker.meet(running, "/yolo/detections", DetectionArray)
        publisher.publish(raw.replace(b"XXXX", b"\xff\xfeab"))
        found = wait_until(lambda: board[DETECTIONS], "detections")
    assert found.value.items[0].class_name == "\ufffd\ufffdab"


def test_a_message_that_is_not_one_harms_nothing(talker: Talker) -> None:
    """Bytes that break off in the middle: the source counts a failure and reads on."""
    board = Board()
    with intake(DEFAULT_SOURCES, board) as running:
        vision = running.sources["vision"]
        publisher = talker.meet(running, "/vision/perf", VisionPerfSummary)
        publisher.publish(serialize_message(VisionPerfSummary())[:30])
        wait_until(lambda: vision.counts.failures == 1, "the failure to be counted")
        assert board[VISION] is None
        talker.say(running, "/vision/perf", VisionPerfSummary(producer_fps=12.0))
        found = wait_until(lambda: board[VISION], "the next message")
    assert found.value.producer_fps == 12.0


def test_a_type_that_is_not_installed_leaves_the_others_alone(talker: Talker) -> None:
    board = Board()
    sources = [
        source.model_copy(update={"type": "no_such_msgs/msg/Thing"}) if source.kind == "vision" else source
        for source in DEFAULT_SOURCES
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(registry._readers, ("no_such_msgs/msg/Thing", VISION), lambda *_: None)
        with intake(sources, board) as running:
            assert "vision" not in running.sources
            talker.say(running, "/odometry/filtered", driving(0.5))
            wait_until(lambda: board[ODOMETRY], "odometry")
    assert "install the ROS package no_such_msgs" in board.unusable[VISION].reason


def test_a_topic_of_another_type_than_configured_does_no_harm(talker: Talker) -> None:
    board = Board()
    with intake(DEFAULT_SOURCES, board) as running:
        talker.publisher("/battery", DiagnosticArray).publish(DiagnosticArray())
        talker.say(running, "/odometry/filtered", driving(0.5))
        wait_until(lambda: board[ODOMETRY], "odometry")
    assert board[BATTERY] is None


def test_a_latched_value_reaches_a_gateway_that_starts_later(talker: Talker) -> None:
    latched = {"durability": DurabilityPolicy.TRANSIENT_LOCAL, "reliability": ReliabilityPolicy.RELIABLE}
    talker.publisher("/battery", BatteryState, **latched).publish(BatteryState(present=True, voltage=15.5))
    source = next(source for source in DEFAULT_SOURCES if source.kind == "battery")
    update = {"durability": "transient_local", "reliability": "reliable"}
    board = Board()
    with intake([source.model_copy(update=update)], board):
        found = wait_until(lambda: board[BATTERY], "the latched value")
    assert found.value.voltage_v == 15.5


def test_of_two_publishers_on_one_topic_the_later_message_counts(talker: Talker) -> None:
    board = Board()
    with intake(DEFAULT_SOURCES, board) as running, talking("second") as second:
        second.publisher("/odometry/filtered", OdometryMessage)
        talker.meet(running, "/odometry/filtered", OdometryMessage, voices=2)

        def drives_at(speed_mps: float) -> bool:
            received = board[ODOMETRY]
            return received is not None and received.value.vx_mps == speed_mps

        for number in range(1, 6):
            for voice in (talker, second):
                speed = number + (0.5 if voice is second else 0.0)
                voice.say(running, "/odometry/filtered", driving(speed), voices=2)
                wait_until(partial(drives_at, speed), f"speed {speed}")
