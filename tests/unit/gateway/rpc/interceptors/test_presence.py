"""A client that stays is reported once when it joins and once when it leaves; one that only looks is not."""

from gateway.access.credential import Principal
from gateway.access.role import Role
from gateway.rpc.interceptors.presence import JOINED_AFTER_S, Presence
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
