"""A client that stays is reported once when it joins and once when it leaves; one that only looks is not."""

from gateway.access.credential import Principal
from gateway.access.role import Role
from gateway.rpc.interceptors.presence import (
    JOINED_AFTER_S,
    MAX_CALLERS,
    REPORTED,
    REPORTED_EVERY_S,
    Presence,
)
from gateway.status.event import ClientJoined, ClientLeft, Event
from tests.support.calls import call_of

ADDRESS = "10.0.0.5:41234"


class World:
    """A clock, and what was reported."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.events: list[Event] = []
        self.presence = Presence(self, lambda: self.now_s)

    def note(self, event: Event) -> None:
        self.events.append(event)

    def reported(self) -> list[object]:
        self.presence.report_joined()
        return [each.detail for each in self.events]


def test_a_client_that_stays_is_reported_once() -> None:
    world = World()
    streams = [call_of("WatchSystemStatus", streaming=True) for _ in range(2)]
    for each in streams:
        world.presence.on_call(each)
    assert world.reported() == []
    world.now_s += JOINED_AFTER_S
    assert world.reported() == [ClientJoined(ADDRESS)]
    assert world.reported() == [ClientJoined(ADDRESS)]
    world.presence.on_end(streams[0], None)
    assert world.reported() == [ClientJoined(ADDRESS)], "one of its two streams is open"
    world.presence.on_end(streams[1], None)
    assert world.reported() == [ClientJoined(ADDRESS), ClientLeft(ADDRESS)]


def test_a_client_that_only_looks_is_not_reported() -> None:
    world = World()
    for _ in range(5):
        stream = call_of("WatchSystemStatus", streaming=True)
        world.presence.on_call(stream)
        world.now_s += JOINED_AFTER_S / 2
        assert world.reported() == []
        world.presence.on_end(stream, None)
    assert world.reported() == []


def test_polling_is_no_presence() -> None:
    assert not World().presence.applies_to(call_of("GetSystemStatus").method)
    assert World().presence.applies_to(call_of("WatchSystemStatus", streaming=True).method)


def test_who_joins_is_named_where_that_is_known() -> None:
    world = World()
    stream = call_of("WatchSystemStatus", streaming=True)
    stream.principal = Principal("anna", Role.VIEWER, ("a1",))
    world.presence.on_call(stream)
    world.now_s += JOINED_AFTER_S
    assert world.reported() == [ClientJoined(ADDRESS, "anna")]
    world.presence.on_end(stream, None)
    assert world.reported()[-1] == ClientLeft(ADDRESS, "anna")
    assert [each.message for each in world.events] == ["anna joined", "anna left"]


def come_and_go(world: World, who: str, times: int, first_port: int = 1) -> None:
    """Clients of this caller, each by a connection of its own, that stay just long enough."""
    for number in range(times):
        stream = call_of("WatchSystemStatus", peer=f"ipv4:10.0.0.5:{first_port + number}", streaming=True)
        stream.principal = Principal(who, Role.VIEWER, ("b1",)) if who else None
        world.presence.on_call(stream)
        world.now_s += JOINED_AFTER_S
        world.presence.report_joined()
        world.presence.on_end(stream, None)


def test_one_that_comes_and_goes_without_end_is_reported_a_few_times() -> None:
    world = World()
    come_and_go(world, "ben", 500)
    minutes = 500 * JOINED_AFTER_S / REPORTED_EVERY_S
    assert len(world.events) <= 2 * (REPORTED + minutes + 1)
    joined = [each for each in world.events if isinstance(each.detail, ClientJoined)]
    left = [each for each in world.events if isinstance(each.detail, ClientLeft)]
    assert len(joined) == len(left), "each that was seen to join is seen to leave"


def test_and_how_often_it_came_meanwhile_is_said_with_the_next_report() -> None:
    world = World()
    come_and_go(world, "ben", REPORTED + 5)
    assert len(world.events) == 2 * REPORTED
    world.now_s += REPORTED_EVERY_S
    come_and_go(world, "ben", 1)
    assert [each.message for each in world.events[-2:]] == [
        "ben joined (5 times more since the last report)",
        "ben left",
    ]


def test_it_hides_no_other_caller() -> None:
    world = World()
    come_and_go(world, "ben", 100)
    seen = len(world.events)
    come_and_go(world, "anna", 1)
    come_and_go(world, "", 1)
    assert [each.message for each in world.events[seen:]] == [
        "anna joined",
        "anna left",
        "10.0.0.5:1 joined",
        "10.0.0.5:1 left",
    ]


def test_callers_that_were_here_long_ago_are_forgotten() -> None:
    world = World()
    for number in range(2000):
        come_and_go(world, f"person {number}", 1)
        world.now_s += REPORTED_EVERY_S
    assert len(vars(world.presence)["_reports"]) <= MAX_CALLERS + 1
