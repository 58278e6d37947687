"""Each event once; what was missed and who speaks is said."""

from console.client import OverlaySnapshot
from console.monitor.snapshot_events import SnapshotEvents
from omniseer.gateway.v1 import overlay_pb2
from tests.support.snapshots import event, snapshot


def listing(*events: overlay_pb2.OperatorEvent, up_ms: int = 0, boot: str = "") -> OverlaySnapshot:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        made.events.extend(events)
        if boot:
            made.status.gateway.boot_id, made.status.gateway.uptime_ms = boot, up_ms

    return snapshot(change)


def texts(log: SnapshotEvents, taken: OverlaySnapshot) -> list[str]:
    return [line.text for line in log.new_lines(taken)]


def test_each_event_is_logged_once_in_order() -> None:
    log = SnapshotEvents()
    assert texts(log, listing(event(5), event(6))) == ["event 5", "event 6"]
    assert texts(log, listing(event(5), event(6))) == []
    assert texts(log, listing(event(6), event(7))) == ["event 7"]


def test_it_happened_when_it_happened() -> None:
    log = SnapshotEvents(clock=lambda: 5000.0)
    (line,) = log.new_lines(listing(event(1, age_ms=1500)))
    assert line.at_s == 4998.5


def test_what_fell_out_between_two_looks_is_counted() -> None:
    log = SnapshotEvents()
    log.new_lines(listing(event(3)))
    assert texts(log, listing(event(12), event(13))) == ["8 events were missed", "event 12", "event 13"]
    assert texts(log, listing(event(15))) == ["1 event was missed", "event 15"]


def test_a_restarted_gateway_begins_anew() -> None:
    log = SnapshotEvents()
    log.new_lines(listing(event(8), boot="a", up_ms=60_000))
    lines = log.new_lines(listing(event(1), event(2), boot="a", up_ms=900))
    assert [line.own for line in lines] == [True, False, False]
    assert [line.text for line in lines][1:] == ["event 1", "event 2"]


def test_a_restarted_gateway_is_noticed_although_its_numbers_have_grown() -> None:
    log = SnapshotEvents()
    log.new_lines(listing(event(1), boot="a", up_ms=60_000))
    assert texts(log, listing(event(1), event(2), boot="a", up_ms=30_000))[1:] == ["event 1", "event 2"]


def test_another_boot_is_another_gateway() -> None:
    log = SnapshotEvents()
    log.new_lines(listing(event(1), boot="a", up_ms=60_000))
    assert texts(log, listing(event(1), boot="b", up_ms=70_000))[1:] == ["event 1"]


def test_an_old_gateway_is_recognized_by_its_numbers() -> None:
    log = SnapshotEvents()
    log.new_lines(listing(event(8)))
    assert texts(log, listing(event(1)))[1:] == ["event 1"]
    assert texts(log, listing())[0].startswith("The gateway was restarted")
