"""Ages, and what becomes of them when topics fall silent, vanish, return, hurry or dawdle."""

import statistics
import threading
import time
from functools import partial
from itertools import pairwise
from pathlib import Path

import psutil
import pytest
from nav_msgs.msg import Odometry as OdometryMessage
from rclpy.qos import QoSProfile, ReliabilityPolicy

from common import ros_transport
from gateway.config import DEFAULT_SOURCES
from gateway.ros.intake import intake
from gateway.status import sources as specs
from gateway.status.board import Board
from gateway.status.values import Received, Velocity
from tests.support.boards import has_all, newest
from tests.support.promise import MS, keeps
from tests.support.ros import simulated_robot
from tests.support.talker import Talker
from tests.support.waiting import wait_until

pytestmark = pytest.mark.ros

ODOMETRY = next(source for source in DEFAULT_SOURCES if source.kind == "odometry")


def age_s(board: Board) -> float:
    """Age of the odometry on the board; infinite when there is none."""
    received = board[specs.ODOMETRY]
    return time.monotonic() - received.at_s if received else float("inf")


@pytest.mark.timed
def test_an_age_is_counted_from_the_reception(talker: Talker) -> None:
    """Not from the moment of sampling, which comes 25 ms later on average."""
    board = Board()

    def another_than(before: Received[Velocity] | None) -> Received[Velocity] | None:
        now = board[specs.ODOMETRY]
        return None if now is before else now

    def median_ms() -> float:
        late_s: list[float] = []
        for _ in range(21):
            before, sent_s = board[specs.ODOMETRY], time.monotonic()
            publisher.publish(OdometryMessage())
            late_s.append(wait_until(partial(another_than, before), "the next message").at_s - sent_s)
            # Somewhere else in the sampler's period each time.
            threading.Event().wait(0.0073 * (len(late_s) % 7))
        assert min(late_s) >= 0, "no message is received before it is sent"
        return statistics.median(late_s) * 1000

    with intake([ODOMETRY], board) as running:
        publisher = talker.meet(running, ODOMETRY.topic, OdometryMessage)
        keeps(12, "ms between the sending and the noted reception", median_ms, per_stalled_s=MS)


def test_a_publisher_whose_clock_is_wrong_does_not_change_the_age(talker: Talker) -> None:
    board = Board()
    message = OdometryMessage()
    message.header.stamp.sec = 1
    with intake([ODOMETRY], board) as running:
        talker.say(running, ODOMETRY.topic, message)
        wait_until(lambda: board[specs.ODOMETRY], "odometry")
        assert age_s(board) < 10


@pytest.mark.usefixtures("ros_domain")
def test_a_silent_topic_ages_and_is_fresh_again_when_it_returns(tmp_path: Path) -> None:
    board = Board()
    with intake(DEFAULT_SOURCES, board), simulated_robot(tmp_path) as robot:
        wait_until(lambda: age_s(board) < 0.2, "fresh odometry")
        robot.change(silent=["odometry"])
        wait_until(
            lambda: age_s(board) > 1.0 and time.monotonic() - newest(board, specs.VISION).at_s < 1.0,
            "odometry, and only that, to become stale",
        )
        robot.change(silent=[])
        wait_until(lambda: age_s(board) < 0.2, "fresh odometry again")


@pytest.mark.usefixtures("ros_domain")
def test_a_robot_that_is_killed_and_comes_back_is_heard_again(tmp_path: Path) -> None:
    board = Board()
    with intake(DEFAULT_SOURCES, board):
        with simulated_robot(tmp_path) as robot:
            wait_until(lambda: age_s(board) < 0.2, "fresh odometry")
            robot.process.kill()
        wait_until(lambda: age_s(board) > 1.0, "odometry to become stale")
        with simulated_robot(tmp_path, "speed_mps=1.75"):
            wait_until(lambda: age_s(board) < 0.2, "fresh odometry again")
            assert newest(board, specs.ODOMETRY).value.vx_mps == 1.75


@pytest.mark.usefixtures("ros_domain")
def test_a_gateway_that_starts_after_the_robot_hears_it(tmp_path: Path) -> None:
    board = Board()
    with simulated_robot(tmp_path), intake(DEFAULT_SOURCES, board):
        wait_until(
            lambda: age_s(board) < 0.2 and has_all(board, specs.BATTERY, specs.DETECTIONS), "all sources"
        )


@pytest.mark.usefixtures("ros_domain")
def test_a_topic_at_1000_hz_is_read_at_the_samplers_pace(tmp_path: Path) -> None:
    board = Board()
    with intake([ODOMETRY], board) as running, simulated_robot(tmp_path, "--odometry-hz", "1000"):
        source = running.sources["odometry"]
        wait_until(lambda: board[specs.ODOMETRY], "odometry")
        before, started_s = source.counts.values, time.monotonic()
        wait_until(lambda: source.counts.values >= before + 20, "20 values")
        assert time.monotonic() - started_s > 0.9, "no more than 20 a second are read"
        wait_until(lambda: age_s(board) < 0.1, "the newest, not one from a queue")


@pytest.mark.usefixtures("ros_domain")
def test_a_topic_every_five_seconds_keeps_its_value_between(tmp_path: Path) -> None:
    """tests/integration/gateway/ros/test_rates.py has one of ten seconds, through the whole program."""
    board = Board()
    with intake([ODOMETRY], board), simulated_robot(tmp_path, "--odometry-hz", "0.2"):
        arrived_s: list[float] = []

        def five_seconds_apart() -> bool:
            """Any two that follow each other: a busy machine may hold one of them up."""
            now = board[specs.ODOMETRY]
            if now and now.at_s not in arrived_s:
                arrived_s.append(now.at_s)
            return any(later - earlier == pytest.approx(5, abs=0.5) for earlier, later in pairwise(arrived_s))

        wait_until(five_seconds_apart, "two messages five seconds apart", within_s=40)


def test_the_board_holds_what_an_ordinary_subscriber_saw_last(
    talker: Talker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Differential: the same messages through rclpy's own way and through ours, by the same transport."""
    monkeypatch.delenv(ros_transport.VARIABLE)
    board = Board()
    seen: list[OdometryMessage] = []
    with intake([ODOMETRY], board) as running:
        qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        plain = talker.node.create_subscription(OdometryMessage, ODOMETRY.topic, seen.append, qos)
        publisher = talker.meet(running, ODOMETRY.topic, OdometryMessage)
        wait_until(lambda: plain.get_publisher_count() > 0, "the plain subscriber")
        for number in range(1, 301):
            message = OdometryMessage()
            message.twist.twist.linear.x = number * 0.5
            message.twist.twist.angular.z = -number * 0.25
            publisher.publish(message)
        last = wait_until(lambda: plain.handle.take_message(OdometryMessage, False), "the last message")[0]
        twist = last.twist.twist
        wait_until(
            lambda: (
                (now := board[specs.ODOMETRY])
                and (now.value.vx_mps, now.value.wz_rad_s) == (twist.linear.x, twist.angular.z)
            ),
            f"{twist.linear.x} on the board",
        )
        assert twist.linear.x == 150.0


@pytest.mark.usefixtures("ros_domain")
def test_starting_and_stopping_leaves_nothing_behind() -> None:
    process = psutil.Process()

    def once() -> None:
        with intake(DEFAULT_SOURCES, Board()):
            pass

    once()  # what is loaded once stays loaded
    files, threads = process.num_fds(), process.num_threads()
    for _ in range(10):
        once()
    wait_until(lambda: process.num_threads() <= threads, "the threads to end")
    wait_until(lambda: process.num_fds() <= files, "the files to be closed")
    assert "ros-sampler" not in {thread.name for thread in threading.enumerate()}


@pytest.mark.usefixtures("ros_domain")
def test_the_board_says_when_ros_was_last_read() -> None:
    board = Board()
    assert board.ros_passed_s is None
    with intake(DEFAULT_SOURCES, board):
        first = wait_until(lambda: board.ros_passed_s, "the first pass")
        assert first
        wait_until(lambda: (board.ros_passed_s or 0) > first, "another pass")
