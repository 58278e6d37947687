"""Why a source does not come: nothing offers it, or in a way that can't reach us."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from sensor_msgs.msg import BatteryState

from gateway.config import DEFAULT_SOURCES, SourceSettings
from gateway.ros.intake import intake
from gateway.ros.readers import registry
from gateway.status import sources as specs
from gateway.status.board import Board, Publishers
from tests.support.talker import Talker, talking
from tests.support.waiting import wait_until

pytestmark = pytest.mark.ros
BATTERY = next(source for source in DEFAULT_SOURCES if source.name == "battery")
RELIABLE = BATTERY.model_copy(update={"reliability": "reliable"})
LATCHED = RELIABLE.model_copy(update={"durability": "transient_local"})
UNRELIABLY = {"reliability": ReliabilityPolicy.BEST_EFFORT}

WaitFor = Callable[[Publishers], None]


@contextmanager
def watching(source: SourceSettings) -> Iterator[tuple[Board, WaitFor]]:
    """A gateway with this one source, and a function that waits until it has seen what is expected."""
    board = Board()
    with intake([source], board):

        def wait_for(expected: Publishers) -> None:
            wait_until(
                lambda: board.publishers.get(source.spec) == expected, f"{expected}, last {board.publishers}"
            )

        yield board, wait_for


def is_heard(publisher: Any, board: Board) -> bool:
    """Publishes a value; whether one has come. A publisher finds its subscriber in its own time."""
    publisher.publish(BatteryState(present=True))
    return board[specs.BATTERY] is not None


def test_publishers_come_and_go(talker: Talker) -> None:
    with watching(BATTERY) as (board, wait_for), talking("second") as second:
        wait_for(Publishers(0))
        talker.publisher(BATTERY.topic, BatteryState)
        wait_for(Publishers(1))
        second.publisher(BATTERY.topic, BatteryState)
        wait_for(Publishers(2))
        talker.fall_silent(BATTERY.topic, BatteryState)
        second.fall_silent(BATTERY.topic, BatteryState)
        wait_for(Publishers(0))
        assert board[specs.BATTERY] is None


@pytest.mark.parametrize(
    ("source", "offered", "words"),
    [
        (RELIABLE, UNRELIABLY, "reliable is requested, best effort is offered"),
        (LATCHED, {}, "transient local is requested, volatile is offered"),
        (
            LATCHED,
            UNRELIABLY,
            "reliable is requested, best effort is offered; "
            "transient local is requested, volatile is offered",
        ),
    ],
)
def test_guarantees_that_exclude_each_other_are_named(
    talker: Talker, source: SourceSettings, offered: dict[str, ReliabilityPolicy], words: str
) -> None:
    with watching(source) as (board, wait_for):
        publisher = talker.publisher(source.topic, BatteryState, **offered)
        wait_for(Publishers(1, qos_mismatch=words))
        publisher.publish(BatteryState(present=True))
        talker.fall_silent(source.topic, BatteryState)
        wait_for(Publishers(0))
        assert board[specs.BATTERY] is None, "the middleware connects only what fits"
        fitting = {
            "reliability": ReliabilityPolicy.RELIABLE,
            "durability": DurabilityPolicy.TRANSIENT_LOCAL,
        }
        fits = talker.publisher(source.topic, BatteryState, **fitting)
        fits.publish(BatteryState(present=True))
        wait_for(Publishers(1))
        if source is LATCHED:  # only there is repeated what was sent before both had met
            wait_until(lambda: board[specs.BATTERY], "the value")
        else:
            wait_until(lambda: is_heard(fits, board), "the value")


def test_one_publisher_that_fits_is_enough(talker: Talker) -> None:
    with watching(RELIABLE) as (_, wait_for), talking("second") as second:
        talker.publisher(RELIABLE.topic, BatteryState, **UNRELIABLY)
        wait_for(Publishers(1, qos_mismatch="reliable is requested, best effort is offered"))
        second.publisher(RELIABLE.topic, BatteryState)
        wait_for(Publishers(2))


def test_another_type_is_distinguished(talker: Talker) -> None:
    with watching(BATTERY) as (board, wait_for), talking("second") as second:
        talker.publisher(BATTERY.topic, Odometry)
        wait_for(Publishers(1, wrong_type=True))
        second.publisher(BATTERY.topic, BatteryState)
        wait_for(Publishers(2))
        fits = second.publisher(BATTERY.topic, BatteryState)
        wait_until(lambda: is_heard(fits, board), "the value of the one that fits")


@pytest.mark.usefixtures("ros_domain")
def test_what_cannot_be_read_is_not_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    missing = "no_such_msgs/msg/Thing"
    monkeypatch.setitem(registry._readers, (missing, specs.BATTERY), lambda *_: None)
    with watching(BATTERY.model_copy(update={"type": missing})) as (board, _):
        assert "no_such_msgs" in board.unusable[specs.BATTERY].reason
        assert not board.publishers
