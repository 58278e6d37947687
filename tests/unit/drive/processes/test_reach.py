"""What the guard says to the worker, over a real pair of sockets, and what the worker makes of it."""

import socket
from collections.abc import Iterator
from dataclasses import dataclass

import pytest

from drive.motion.values import MS
from drive.processes.reach import ReachHeard, ReachSaid


@dataclass
class Pair:
    """Guard and worker, each with its end."""

    guard: socket.socket
    worker: socket.socket
    now_ms: int = 0

    def __post_init__(self) -> None:
        self.said, self.heard = ReachSaid(self.guard), ReachHeard(self.worker)

    def reaches(self, *, guard: int, worker: int, after_ms: int = 20) -> bool:
        """Whether the guard reaches what the worker reaches, with so many subscriptions matched by each."""
        self.now_ms += after_ms
        self.said.say(guard)
        return self.heard.reaches(worker, self.now_ms * MS)


@pytest.fixture
def pair() -> Iterator[Pair]:
    guard, worker = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with guard, worker:
        yield Pair(guard, worker)


def test_a_guard_that_has_said_nothing_reaches_nothing(pair: Pair) -> None:
    assert not pair.heard.reaches(1, 0)


def test_at_first_the_guard_needs_all_that_the_worker_has(pair: Pair) -> None:
    assert not pair.reaches(guard=0, worker=1)
    assert not pair.reaches(guard=1, worker=2), "the base may be the other one"
    assert not pair.reaches(guard=1, worker=2, after_ms=10_000)
    assert pair.reaches(guard=2, worker=2)


def test_without_the_base_there_is_nothing_to_reach_and_it_begins_anew(pair: Pair) -> None:
    assert pair.reaches(guard=2, worker=2)
    assert not pair.reaches(guard=1, worker=0)
    assert not pair.reaches(guard=1, worker=2)
    assert pair.reaches(guard=2, worker=2)


def test_another_subscription_does_not_stop_a_driven_robot_at_once(pair: Pair) -> None:
    assert pair.reaches(guard=1, worker=1)
    assert pair.reaches(guard=1, worker=2)
    assert pair.reaches(guard=1, worker=2, after_ms=4000)
    assert not pair.reaches(guard=1, worker=2, after_ms=2000)
    assert pair.reaches(guard=2, worker=2)


def test_a_dead_observer_may_leave_the_guard_first(pair: Pair) -> None:
    assert pair.reaches(guard=2, worker=2)
    for _ in range(10):
        assert pair.reaches(guard=1, worker=2, after_ms=1000)
    assert pair.reaches(guard=1, worker=1)
    assert not pair.reaches(guard=0, worker=1)


def test_it_is_said_when_it_changes(pair: Pair) -> None:
    for _ in range(3):
        pair.said.say(1)
    assert pair.worker.recv(16, socket.MSG_DONTWAIT) == b"1"
    with pytest.raises(BlockingIOError):
        pair.worker.recv(16, socket.MSG_DONTWAIT)


def test_a_worker_that_reads_nothing_holds_up_no_guard_and_hears_the_newest_later(pair: Pair) -> None:
    for number in range(10_000):
        pair.said.say(1 + number % 2)
    for number in range(1000):
        pair.heard.reaches(1, number)
    assert pair.reaches(guard=3, worker=3)


def test_the_end_of_either_side_raises_nothing(pair: Pair) -> None:
    assert pair.reaches(guard=1, worker=1)
    pair.guard.close()
    assert pair.heard.reaches(1, 0), "the next heartbeat finds out"
    other, ours = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with other:
        ours.close()
        ReachSaid(other).say(1)
