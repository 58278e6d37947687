"""The lock of the multiplexer, on a topic that the test makes up: what is published, and the problems."""

from dataclasses import dataclass, field

import pytest

from drive.motion.values import MS
from drive.ros.lock import Lock

BEGAN_MS = 1000
DISCOVERED_MS = BEGAN_MS + 3000


@dataclass
class Topic:
    """What other programs publish, and the lock's own messages."""

    name: str = "/lock"
    discovered: tuple[str, ...] = ()
    published: list[bool] = field(default_factory=list)
    arrived: bool | None = None
    left: bool = False

    def __post_init__(self) -> None:
        self.lock = Lock(self, BEGAN_MS * MS, left=self.left)

    def publish(self, *, active: bool) -> None:
        self.published.append(active)
        self.arrived = active

    def newest(self) -> bool | None:
        newest, self.arrived = self.arrived, None
        return newest

    def others(self) -> tuple[str, ...]:
        return self.discovered

    def locks(self, at_ms: float) -> None:
        assert self.lock.publish(int(at_ms * MS), active=True)

    def releases(self, at_ms: float) -> bool:
        """Requests a release; returns whether it is decided."""
        return self.lock.publish(int(at_ms * MS), active=False)

    def is_left(self) -> bool:
        return self.lock.left

    def problem(self, at_ms: float) -> str:
        self.lock.observe(int(at_ms * MS))
        return self.lock.problem


@pytest.fixture
def topic() -> Topic:
    return Topic()


def test_a_lock_that_no_other_program_publishes_is_released(topic: Topic) -> None:
    topic.locks(DISCOVERED_MS)
    assert topic.problem(DISCOVERED_MS + 100) == ""
    assert topic.releases(DISCOVERED_MS + 1000)
    assert topic.published == [True, False]
    for after_ms in range(1100, 3000, 100):
        assert topic.problem(DISCOVERED_MS + after_ms) == ""


def test_nothing_is_released_before_other_programs_can_be_discovered(topic: Topic) -> None:
    """The defect: a graph in which nothing is discovered yet was taken for one without other publishers."""
    topic.locks(BEGAN_MS + 500)
    assert not topic.releases(BEGAN_MS + 600)
    assert not topic.releases(DISCOVERED_MS - 1)
    assert topic.published == [True]
    assert "until 3 s after the start of robot-drive" in topic.problem(DISCOVERED_MS - 1)
    topic.discovered = ("button",)
    assert topic.releases(DISCOVERED_MS)
    assert topic.published == [True]
    assert "release it where it was pressed (button)" in topic.problem(DISCOVERED_MS + 1000)


def test_a_release_that_has_waited_is_published(topic: Topic) -> None:
    topic.locks(BEGAN_MS + 500)
    assert not topic.releases(BEGAN_MS + 600)
    assert topic.releases(DISCOVERED_MS)
    assert topic.published == [True, False]
    assert topic.problem(DISCOVERED_MS + 1000) == ""


def test_a_lock_that_is_released_elsewhere_meanwhile_is_no_problem(topic: Topic) -> None:
    topic.locks(BEGAN_MS + 500)
    assert not topic.releases(BEGAN_MS + 600)
    topic.arrived = False
    assert topic.problem(BEGAN_MS + 700) == ""


def test_it_says_during_a_stop_that_its_reset_will_not_release_it(topic: Topic) -> None:
    topic.discovered = ("button",)
    topic.locks(DISCOVERED_MS)
    assert topic.problem(DISCOVERED_MS + 500) == (
        "button publishes the lock on /lock, too: the reset of a stop does not release it"
    )
    assert topic.releases(DISCOVERED_MS + 600)
    assert topic.published == [True]


def test_a_lock_of_another_program_is_named_until_that_one_releases_it(topic: Topic) -> None:
    topic.discovered = ("button",)
    topic.arrived = True
    assert "(button)" in topic.problem(DISCOVERED_MS)
    assert topic.problem(DISCOVERED_MS + 5000)
    topic.arrived = False
    assert topic.problem(DISCOVERED_MS + 5100) == ""
    assert topic.published == []


def test_a_lock_that_is_left_by_a_program_that_has_gone_says_what_to_type(topic: Topic) -> None:
    topic.arrived = True
    problem = topic.problem(DISCOVERED_MS)
    assert "by a program that has gone" in problem
    assert "ros2 topic pub --once /lock std_msgs/msg/Bool '{data: false}'" in problem


def test_a_lock_that_an_earlier_process_has_left_is_named_until_it_is_released() -> None:
    """The defect: the next worker heard nothing, and the problem was gone while the robot was locked."""
    topic = Topic(left=True)
    assert "it is not known yet by which program" in topic.problem(BEGAN_MS + 100)
    topic.discovered = ("button",)
    assert "(button)" in topic.problem(DISCOVERED_MS)
    assert topic.is_left()
    topic.arrived = False
    assert topic.problem(DISCOVERED_MS + 100) == ""
    assert not topic.is_left()
    assert topic.published == []


def test_it_is_left_until_its_release_is_published_or_heard(topic: Topic) -> None:
    assert not topic.is_left()
    topic.locks(DISCOVERED_MS)
    topic.arrived = False
    topic.problem(DISCOVERED_MS + 100)
    assert topic.is_left(), "it is published again in the next cycle"
    topic.discovered = ("button",)
    topic.releases(DISCOVERED_MS + 200)
    assert topic.is_left()
    topic.discovered = ()
    topic.releases(DISCOVERED_MS + 300)
    assert not topic.is_left()


def test_a_lock_of_another_program_is_not_left_by_this_one(topic: Topic) -> None:
    topic.arrived = True
    assert topic.problem(DISCOVERED_MS)
    assert not topic.is_left()
