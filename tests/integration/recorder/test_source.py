"""One channel's subscription while the next one takes its place, with queues in place of the middleware."""

from collections import deque
from dataclasses import dataclass, field
from typing import Any

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile

from common.receive_time import Instant
from recorder.intake.source import OVERLAP_S, Source
from recorder.values import Channel, Loss

SECOND_NS = 1_000_000_000
START_NS = 1_000 * SECOND_NS


@dataclass
class Queue:
    """A subscription: what it has received, or the error that it raises instead."""

    waiting: deque[tuple[int, int] | Exception] = field(default_factory=deque)

    @property
    def handle(self) -> "Queue":
        return self

    def receive(self, *messages: tuple[int, int]) -> None:
        """Takes messages: number and source time in seconds after the start."""
        self.waiting.extend(messages)

    def take_message(self, _type: Any, _raw: bool) -> tuple[bytes, dict[str, Any]] | None:
        if not self.waiting:
            return None
        if isinstance(self.waiting[0], Exception):
            raise self.waiting.popleft()  # type: ignore[misc]
        number, published_s = self.waiting.popleft()  # type: ignore[misc]
        published_ns = START_NS + published_s * SECOND_NS
        return b"", {
            "received_timestamp": published_ns,
            "source_timestamp": published_ns,
            "publication_sequence_number": number,
        }


@dataclass
class Node:
    """Makes the subscriptions."""

    made: list[Queue] = field(default_factory=list)

    def create_subscription(self, *_arguments: Any, **_keywords: Any) -> Queue:
        self.made.append(Queue())
        return self.made[-1]

    def destroy_subscription(self, subscription: Queue) -> None:
        subscription.waiting.clear()

    def count_publishers(self, _topic: str) -> int:
        return 1


@dataclass(frozen=True)
class Offer:
    """An endpoint that keeps messages for late subscribers."""

    endpoint_gid: tuple[int, ...] = (1,)
    qos_profile: QoSProfile = field(
        default_factory=lambda: QoSProfile(durability=DurabilityPolicy.TRANSIENT_LOCAL, depth=5)
    )


def at(seconds: float) -> Instant:
    return Instant(seconds, START_NS + round(seconds * SECOND_NS))


class Replaced:
    """A source whose publishers could not be examined at first: its first subscription is volatile."""

    def __init__(self, *publishers: Offer) -> None:
        self.offers, self.node = publishers or (Offer(),), Node()
        channel = Channel("/map", "a/msg/B", b"", "", "", latched=False, presets=frozenset())
        self.source = Source(self.node, None, channel, (), at(0))
        self.former = self.node.made[0]

    def replace(self, seconds: float) -> Queue:
        """Makes the next subscription, and returns it."""
        self.update(seconds)
        return self.node.made[1]

    def update(self, seconds: float) -> Loss | None:
        return self.source.update(self.offers, at(seconds))

    def take(self, seconds: float) -> list[int]:
        """Makes a pass; returns the numbers of the messages."""
        return [each.sequence for each in self.source.take(at(seconds))]


@pytest.fixture
def replaced() -> Replaced:
    return Replaced()


def test_a_live_message_of_a_clock_that_lags_is_not_lost_if_the_next_subscription_has_it_first() -> None:
    """The defect: it was recorded, and counted as lost."""
    replaced = Replaced(Offer((1,)), Offer((2,)))
    replaced.former.receive((500, 1), (1, -100), (2, -99))
    assert replaced.take(1) == [500, 1, 2]
    following = replaced.replace(2)
    following.receive((1, -100), (2, -99), (3, -98))
    assert replaced.take(2.1) == [1, 2, 3]
    replaced.former.receive((3, -98), (4, -97))
    following.receive((4, -97))
    assert replaced.take(2.2) == [4]
    assert replaced.update(2.3) is None
    following.receive((5, -96))
    assert replaced.take(2 + OVERLAP_S) == [5], "its copy can come no more: the former one ends"
    following.receive((6, -95))
    assert replaced.take(4) == [6]
    assert replaced.update(4) is None
    assert not replaced.take(20)
    following.receive((8, -93), (501, 5))
    replaced.take(60)
    lost = replaced.update(60)
    assert lost
    assert lost.messages == 1


def test_a_live_message_of_a_clock_that_lags_is_not_lost_if_the_next_subscription_alone_has_it() -> None:
    """The defect: where the former one's queue ran over, it was recorded, and counted as lost."""
    replaced = Replaced(Offer((1,)), Offer((2,)))
    replaced.former.receive((500, 1), (1, -100), (2, -99))
    replaced.take(1)
    following = replaced.replace(2)
    following.receive((3, -98), (4, -97))
    assert replaced.take(2.1) == [3, 4]
    replaced.former.receive((4, -97), (6, -95))
    following.receive((5, -96), (6, -95))
    assert replaced.take(2.2) == [6, 5]
    assert replaced.update(2.3) is None
    following.receive((7, -94), (8, -93))
    replaced.take(2.4)
    following.receive((10, -91))
    assert replaced.take(2 + OVERLAP_S) == [10]
    assert not replaced.take(20)
    following.receive((11, -90), (501, 5))
    replaced.take(60)
    lost = replaced.update(60)
    assert lost
    assert lost.messages == 1


def test_history_is_no_gap_where_nothing_was_heard_before_the_replacement(replaced: Replaced) -> None:
    """The defect: a live message that came before it made it a restart, a gap of unknown size."""
    following = replaced.replace(2)
    replaced.former.receive((6, 2))
    assert replaced.take(2.1) == [6]
    following.receive(*((number, number - 100) for number in range(1, 6)), (6, 2))
    assert replaced.take(2.2) == [1, 2, 3, 4, 5]
    assert replaced.update(2.3) is None


def test_history_of_a_clock_that_is_ahead_is_no_gap_where_nothing_was_heard_before(
    replaced: Replaced,
) -> None:
    following = replaced.replace(2)
    replaced.former.receive((6, 902))
    assert replaced.take(2.1) == [6]
    following.receive(*((number, number + 800) for number in range(1, 6)), (6, 902))
    assert replaced.take(2.2) == [1, 2, 3, 4, 5]
    assert replaced.update(2.3) is None


@pytest.mark.parametrize("pass_at_s", [2 + OVERLAP_S, 60.0], ids=["at the switch", "after a stall"])
@pytest.mark.parametrize("late", [False, True], ids=["before the switch", "after the switch"])
def test_history_that_comes_late_is_no_gap(replaced: Replaced, late: bool, pass_at_s: float) -> None:
    """The defect: discovery took longer than the two subscriptions were there side by side."""
    replaced.former.receive((2, 0), (3, 1))
    assert replaced.take(1) == [2, 3]
    following = replaced.replace(2)
    if late:
        assert not replaced.take(2 + OVERLAP_S)
    following.receive((1, -1), (2, 0), (3, 1), (4, 2))
    assert replaced.take(pass_at_s) == [1, 2, 3, 4]
    assert replaced.update(pass_at_s) is None
    following.receive((6, 70))
    replaced.take(70)
    lost = replaced.update(70)
    assert lost
    assert lost.messages == 1


def test_late_history_of_one_publisher_is_not_taken_for_messages_of_another() -> None:
    replaced = Replaced(Offer((1,)), Offer((2,)))
    replaced.former.receive((6, -50), (700, 1))
    replaced.take(1)
    following = replaced.replace(2)
    assert not replaced.take(2 + OVERLAP_S)
    following.receive(*((number, number - 700) for number in range(690, 701)), (7, 3))
    replaced.take(4)
    assert replaced.update(4) is None
    following.receive((8, 5), (701, 5), (703, 6))
    replaced.take(7)
    lost = replaced.update(7)
    assert lost
    assert lost.messages == 1


def test_an_error_of_the_next_subscription_costs_nothing_that_the_former_one_has(replaced: Replaced) -> None:
    """The defect: what that had was taken, and the next one's copy counted as a repetition."""
    replaced.former.receive((1, 1))
    assert replaced.take(1) == [1]
    following = replaced.replace(2)
    replaced.former.receive((2, 2))
    following.waiting.extend([OSError("no"), OSError("no again"), (2, 2), (3, 3)])
    assert replaced.take(2.1) == [2]
    with pytest.raises(OSError, match="no again"):
        replaced.take(2.2)
    assert replaced.take(2.3) == [3]
    assert replaced.update(2.3) is None


def test_a_publisher_that_starts_again_long_after_is_a_gap_of_unknown_size(replaced: Replaced) -> None:
    replaced.former.receive((5, 1))
    replaced.take(1)
    following = replaced.replace(2)
    replaced.take(2 + OVERLAP_S)
    replaced.take(20)
    following.receive((1, -500), (2, -499))
    replaced.take(21)
    lost = replaced.update(21)
    assert lost
    assert lost.messages is None
