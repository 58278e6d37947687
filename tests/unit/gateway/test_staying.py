"""Who stays is told of once when it comes and once when it goes; who only looks is not."""

from contextlib import ExitStack

from gateway.rpc.staying import STAYS_AFTER_S, Staying
from gateway.status.event import ClientJoined, ClientLeft, News


class World:
    """A clock, and what was told."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.news: list[News] = []
        self.staying = Staying(self.news.append, lambda: self.now_s)

    def told(self) -> list[object]:
        self.staying.look()
        return [each.detail for each in self.news]


def test_who_stays_is_told_of_once() -> None:
    world = World()
    with world.staying.stream("a"), world.staying.stream("a"):
        assert world.told() == []
        world.now_s += STAYS_AFTER_S
        assert world.told() == [ClientJoined("a")]
        assert world.told() == [ClientJoined("a")]
    assert world.told() == [ClientJoined("a"), ClientLeft("a")]


def test_who_only_looks_is_no_news() -> None:
    world = World()
    for _ in range(5):
        with world.staying.stream("a"):
            world.now_s += STAYS_AFTER_S / 2
            assert world.told() == []
    assert world.told() == []


def test_one_of_two_streams_that_ends_is_no_leaving() -> None:
    world = World()
    with ExitStack() as both:
        both.enter_context(world.staying.stream("a"))
        with world.staying.stream("a"):
            world.now_s += STAYS_AFTER_S
            world.told()
        assert world.told() == [ClientJoined("a")]
    assert world.told() == [ClientJoined("a"), ClientLeft("a")]
