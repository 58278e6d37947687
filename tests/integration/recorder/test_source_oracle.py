"""One channel's subscription, with an oracle that knows whose each message is and what was recorded."""

from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from std_msgs.msg import String

from common.receive_time import Instant
from recorder.intake.source import OVERLAP_S, Source
from tests.integration.recorder.test_history import VOLATILE, Message, Node, Subscription, offer
from tests.support.segments import STRING

OVERLAP_MS = round(OVERLAP_S * 1_000)


@dataclass
class Publisher:
    """One of those that are transient local."""

    next_number: int
    ahead_ms: int
    """By how much its clock is ahead."""
    published: list[Message] = field(default_factory=list)
    discovered: bool = False
    """By the next subscription."""

    def missing(self, recorded: set[Message]) -> set[Message]:
        """Returns the messages between two recorded ones that are not."""
        there = [at for at, each in enumerate(self.published) if each in recorded]
        return set(self.published[there[0] : there[-1]]) - recorded if there else set()


class Robot:
    """A source whose subscription is replaced once the volatile publisher beside the others has gone."""

    def __init__(self, publishers: list[Publisher], kept: int) -> None:
        self._kept = kept
        self.publishers, self._node, self._now_ms = publishers, Node(), 1_000_000
        self._offers = [offer(number) for number in range(10, 10 + len(publishers))]
        self._source = Source(self._node, String, STRING, (*self._offers, VOLATILE), self._now)
        assert self._source.update((*self._offers, VOLATILE), self._now) is None
        self._recorded: set[Message] = set()
        self._were_missing: set[Message] = set()
        self._counted = self._unknown = 0
        self._node.subscriptions[0].give((900_000, 1))
        for each in publishers:
            self.publish(each)
        self.take()

    @property
    def following(self) -> Subscription | None:
        """The next subscription."""
        return self._node.subscriptions[1] if len(self._node.subscriptions) > 1 else None

    def wait(self, ms: int) -> None:
        self._now_ms += ms

    def publish(self, publisher: Publisher, *, to_former: bool = True, to_next: bool = True) -> None:
        """Publishes a message, which is lost on its way to either subscription or not."""
        self.wait(1)
        message = publisher.next_number, self._now_ms + publisher.ahead_ms
        publisher.next_number += 1
        publisher.published.append(message)
        if to_former:
            self._node.subscriptions[0].give(message)
        if to_next and self.following and publisher.discovered:
            self.following.give(message)

    def discover(self, publisher: Publisher) -> None:
        """Gives the next subscription what the publisher has kept."""
        if self.following and not publisher.discovered:
            publisher.discovered = True
            self.following.give(*publisher.published[-self._kept :])

    def take(self) -> None:
        samples = self._source.take(self._now)
        self._recorded |= {(each.sequence, each.publish_time_ns // 1_000_000) for each in samples}

    def look(self) -> None:
        """Looks at the graph; what is missing by then may count as lost, also if it comes later."""
        lost = self._source.update(self._offers, self._now)
        self._were_missing |= self._missing()
        if lost:
            self._unknown += lost.messages is None
            self._counted += lost.messages or 0

    def counted(self) -> tuple[int, int, int, int]:
        """Returns the least, the number and the most that may count as lost, and the gaps of unknown size."""
        for each in self.publishers:
            self.publish(each)
        self.take()
        self.look()
        return len(self._missing()), self._counted, len(self._were_missing), self._unknown

    def _missing(self) -> set[Message]:
        return {message for each in self.publishers for message in each.missing(self._recorded)}

    @property
    def _now(self) -> Instant:
        return Instant(self._now_ms / 1_000, self._now_ms * 1_000_000)


def replaced(
    numbers: list[int], clocks_ms: list[int], order: Random, *, kept: int, loses: Callable[[], bool]
) -> Robot:
    """Returns a robot whose subscription was replaced, while its publishers sent in any order.

    Args:
        numbers: of their first messages.
        clocks_ms: by how much their clocks may be ahead.
        order: decides all that may happen or not.
        kept: messages that each publisher keeps for late subscribers.
        loses: returns whether a message is lost on its way to a subscription.
    """
    clocks = order.choices(clocks_ms, k=len(numbers))
    robot = Robot([Publisher(*each) for each in zip(numbers, clocks, strict=True)], kept)

    def step(*, ends: bool = False) -> None:
        robot.wait(order.choice([1, 10, 300]))
        for _ in range(order.randrange(4)):
            robot.publish(
                order.choice(robot.publishers), to_former=not (ends or loses()), to_next=not loses()
            )
        for each in robot.publishers:
            if order.random() < 0.2:
                robot.discover(each)
        if order.random() < 0.5:
            robot.take()
            robot.look()

    for _ in range(order.randrange(4)):
        step()
    robot.wait(1_000)
    robot.take()
    robot.look()
    assert robot.following
    for _ in range(order.randrange(6)):
        step()
    robot.wait(OVERLAP_MS)
    robot.take()  # The former subscription ends.
    for _ in range(order.randrange(6)):
        step(ends=True)
    for each in robot.publishers:
        robot.discover(each)
    for ms in (0, 20_000, 40_000):
        robot.wait(ms)
        robot.take()
    return robot


CLOCKS = pytest.mark.parametrize(
    "clocks_ms", [[0], [0, -100_000], [0, 100_000]], ids=["same", "behind", "ahead"]
)
ORDER = st.randoms(use_true_random=False)


@CLOCKS
@settings(derandomize=True)
@given(order=ORDER)
def test_what_is_lost_of_publishers_whose_numbers_are_apart_is_counted(
    clocks_ms: list[int], order: Random
) -> None:
    numbers = order.sample([1, 1_000, 20_000], k=order.randint(1, 3))
    robot = replaced(numbers, clocks_ms, order, kept=5, loses=lambda: order.random() < 0.25)
    least, counted, most, unknown = robot.counted()
    assert least <= counted <= most
    assert not unknown


@CLOCKS
@settings(derandomize=True)
@given(order=ORDER)
def test_where_nothing_is_lost_nothing_is_counted_whatever_the_numbers(
    clocks_ms: list[int], order: Random
) -> None:
    """Of three with a late history something may be, rarely: nothing says whose a number is."""
    numbers = [order.randint(1, 8) for _ in range(order.randint(1, 2))]
    robot = replaced(numbers, clocks_ms, order, kept=100, loses=lambda: False)
    assert robot.counted()[1:] == (0, 0, 0)
