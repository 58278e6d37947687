"""What transient local publishers keep comes again when a subscription is replaced: none of it was lost.

A subscription that is handed what the middleware would deliver stands for one of the graph: when the history
comes, and how long it is, is of the test's choice.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from itertools import count
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from common.receive_time import Instant
from recorder.intake.source import OVERLAP_S, Source
from recorder.values import Loss, Sample
from tests.support.segments import STRING

Message = tuple[int, int]
"""Its number, and its source time in ms."""


class Subscription:
    """One that has what a test gives it."""

    def __init__(self, received_ns: Iterator[int]) -> None:
        self.handle = self
        self._received_ns = received_ns
        self._messages: deque[Message] = deque()

    def give(self, *messages: Message) -> None:
        self._messages.extend(messages)

    def take_message(self, _type: Any, _raw: bool) -> Any:
        if not self._messages:
            return None
        number, published_ms = self._messages.popleft()
        return b"", {
            "received_timestamp": next(self._received_ns),
            "source_timestamp": published_ms * 1_000_000,
            "publication_sequence_number": number,
        }


class Node:
    """Has the subscriptions that a source makes, in order."""

    def __init__(self) -> None:
        self.subscriptions: list[Subscription] = []
        self._received_ns = count(1)

    def create_subscription(self, *_: Any, **_named: Any) -> Subscription:
        self.subscriptions.append(Subscription(self._received_ns))
        return self.subscriptions[-1]

    def destroy_subscription(self, _subscription: Subscription) -> None:
        pass

    def count_publishers(self, _topic: str) -> int:
        return 1


def offer(name: int, durability: DurabilityPolicy = DurabilityPolicy.TRANSIENT_LOCAL) -> Any:
    """Returns a publisher's endpoint, as the graph has it."""
    return SimpleNamespace(
        endpoint_gid=[name], qos_profile=QoSProfile(durability=durability, depth=5), topic_type=STRING.type
    )


A, B = offer(1), offer(2)
VOLATILE = offer(3, DurabilityPolicy.VOLATILE)


class Robot:
    """A source whose subscription is replaced by a transient local one, with the graph as it is by then."""

    def __init__(self, first: Sequence[Any] | None) -> None:
        self.node = Node()
        self._now_s = 0.0
        self._first = first
        self._source = Source(self.node, String, STRING, first or (), self._now)

    def receive(self, *messages: Message) -> list[Sample]:
        """Lets the newest subscription have messages."""
        self.node.subscriptions[-1].give(*messages)
        return self.take()

    def take(self) -> list[Sample]:
        return self._source.take(self._now)

    def look(self, offers: Sequence[Any] | None) -> Loss | None:
        """Lets the source know the publishers, once the subscription may be replaced."""
        self._now_s += OVERLAP_S
        return self._source.update(offers, self._now)

    @property
    def _now(self) -> Instant:
        return Instant(self._now_s, int(self._now_s * 1e9))


@pytest.mark.parametrize("heard_from", [1, 4], ids=["all heard before", "the newest alone heard before"])
def test_the_history_of_a_publisher_that_could_not_be_examined_was_not_lost(heard_from: int) -> None:
    """The defect: a gap of unknown size, as if the publisher had been started again."""
    history = [(number, number * 10) for number in range(1, 6)]
    robot = Robot(None)
    robot.receive(*history[heard_from - 1 :])
    assert robot.look(None) is None
    assert robot.look([A]) is None
    former, following = robot.node.subscriptions
    assert [each.sequence for each in robot.receive(*history)] == [1, 2, 3, 4, 5], "for later segments"
    following.give((6, 60))
    former.give((6, 60), (7, 70))
    assert [each.sequence for each in robot.take()] == [6, 7], "once"
    assert robot.look([A]) is None
    following.give((7, 70), (8, 80))
    assert [each.sequence for each in robot.take()] == [8]
    assert robot.look([A]) is None
    robot.receive((10, 100))
    lost = robot.look([A])
    assert lost
    assert lost.messages == 1


def test_the_histories_of_two_publishers_that_a_volatile_one_leaves_were_not_lost() -> None:
    robot = Robot([A, B, VOLATILE])
    first = [(number, number * 10) for number in range(1, 4)]
    second = [(number, number * 10 + 1) for number in range(1, 4)]
    robot.receive(*first, *second, (700, 50))
    assert robot.look([A, B, VOLATILE]) is None
    assert robot.look([A, B]) is None
    assert len(robot.receive(*second, *first)) == 6, "for later segments"
    assert robot.look([A, B]) is None
    robot.receive((4, 60), (4, 61), (5, 70), (7, 71))
    lost = robot.look([A, B])
    assert lost
    assert lost.messages == 1


def test_what_a_longer_queue_has_of_a_history_that_ran_over_was_not_lost() -> None:
    """Of a history that comes faster than it is taken, the subscription has the newest alone."""
    history = [(number, number) for number in range(1, 601)]
    robot = Robot([A])
    robot.receive(*history[400:])
    assert robot.look([A]) is None
    former, following = robot.node.subscriptions
    assert [each.sequence for each in robot.receive(*history)] == list(range(1, 401)), "what is new"
    for each in (former, following):
        each.give((601, 700))
    robot.take()
    assert robot.look([A]) is None
    robot.receive((603, 800))
    lost = robot.look([A])
    assert lost
    assert lost.messages == 1
