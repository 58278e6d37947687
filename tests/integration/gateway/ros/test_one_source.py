"""One source on a real subscription, looked at when the test says so instead of twenty times a second."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry
from rclpy.duration import Duration

from common.ros_node import ros_node
from gateway.config import DEFAULT_SOURCES
from gateway.ros import source as source_module
from gateway.ros.source import Source
from gateway.ros.subscription import subscribe
from gateway.status import values
from gateway.status.board import Board
from gateway.status.sources import DIAGNOSTICS, ODOMETRY
from gateway.status.values import Received
from tests.support.boards import newest
from tests.support.talker import Talker
from tests.support.waiting import wait_until

pytestmark = pytest.mark.ros

YEAR_NS = 365 * 24 * 3600 * 10**9


@contextmanager
def met(talker: Talker, name: str, message_type: Any) -> Iterator[tuple[Source, Board, Any]]:
    """A reliable source that nothing samples, its board, and a publisher that has met it."""
    settings = next(each for each in DEFAULT_SOURCES if each.name == name)
    settings = settings.model_copy(update={"reliability": "reliable"})
    board = Board()
    with ros_node("one_source") as node:
        source = Source(settings, subscribe(node, settings), board, created_at_s=time.monotonic())
        publisher = talker.publisher(settings.topic, message_type, depth=64)
        wait_until(
            lambda: publisher.get_subscription_count() > 0 and source.publisher_count > 0, "both to meet"
        )
        yield source, board, publisher


def arrived(publisher: Any) -> None:
    """Returns when everything that was published lies in the subscription's queue."""
    assert publisher.wait_for_all_acked(Duration(seconds=20))


def test_a_burst_that_came_since_the_last_look_is_taken_whole(talker: Talker) -> None:
    with met(talker, "diagnostics", DiagnosticArray) as (source, board, publisher):
        for number in range(40):
            publisher.publish(DiagnosticArray(status=[DiagnosticStatus(name=str(number))]))
        arrived(publisher)
        source.take()
        assert [item.component for item in newest(board, DIAGNOSTICS).value.items] == [
            str(n) for n in range(40)
        ]


def test_of_a_late_burst_the_newest_value_counts_with_its_own_age(talker: Talker) -> None:
    with met(talker, "odometry", Odometry) as (source, board, publisher):
        for number in range(1, 11):
            message = Odometry()
            message.twist.twist.linear.x = float(number)
            publisher.publish(message)
        before_s = time.monotonic()
        arrived(publisher)
        # The messages wait unread for a while: this much older they are.
        wait_until(lambda: time.monotonic() - before_s > 0.5, "half a second")
        source.take()
        assert newest(board, ODOMETRY).value.vx_mps == 10.0
        assert time.monotonic() - newest(board, ODOMETRY).at_s > 0.3
        assert source.counts.values == 1


@pytest.mark.parametrize("jump_ns", [10 * YEAR_NS, -10 * YEAR_NS])
def test_a_system_clock_that_jumps_costs_an_age_no_more_than_the_time_between_two_looks(
    talker: Talker, monkeypatch: pytest.MonkeyPatch, jump_ns: int
) -> None:
    with met(talker, "odometry", Odometry) as (source, board, publisher):
        created_s = time.monotonic()
        wait_until(lambda: time.monotonic() - created_s > 0.3, "a while since the subscription was made")
        looked_s = time.monotonic()
        source.take()
        assert board[ODOMETRY] is None
        publisher.publish(Odometry())
        arrived(publisher)
        jumped = SimpleNamespace(
            monotonic=time.monotonic,
            thread_time=time.thread_time,
            time_ns=lambda: time.time_ns() + jump_ns,
        )
        monkeypatch.setattr(source_module, "time", jumped)

        def taken() -> Received[values.Velocity] | None:
            source.take()
            return board[ODOMETRY]

        # After the first look, which decodes nothing but loads the decoder, the source may still be at rest.
        received = wait_until(taken, "the message is taken")
        assert looked_s <= received.at_s <= time.monotonic()
