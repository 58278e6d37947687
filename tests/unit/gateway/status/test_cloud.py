"""The bridge as its link sees it, report by report."""

from dataclasses import replace

from gateway.status.cloud import CloudState
from tests.support.cloud_views import NEVER, connected, report, view

OFFLINE = connected(state=CloudState.OFFLINE, state_age_ms=2000)


def test_before_the_first_report_it_is_unreachable() -> None:
    status = NEVER.status(7.0)
    assert not NEVER.reachable
    assert (status.state, status.state_age_ms) == (CloudState.UNREACHABLE, 7000)
    assert status.last_error == "not connected yet"


def test_ages_count_on_between_reports() -> None:
    status = view(connected(state_age_ms=1000, last_sent_age_ms=5), 10.0).status(10.5)
    assert (status.state_age_ms, status.last_sent_age_ms) == (1500, 505)
    assert view(connected(), 10.0).status(10.5).last_sent_age_ms is None


def test_one_that_was_lost_keeps_its_name_alone() -> None:
    lost = view(connected(outbox_events=7), 10.0).lost("gone", 12.0)
    again = lost.lost("still gone", 15.0)
    status = again.status(16.0)
    assert (status.state, status.robot, status.outbox_events) == (CloudState.UNREACHABLE, "lab-1", 0)
    assert (status.state_age_ms, status.last_error) == (4000, "still gone")
    assert again.newest is None
    assert again.reported(report(), 17.0).since_s == 17.0


def test_the_time_without_a_hub_counts_on_over_a_restart_of_the_bridge() -> None:
    offline = view(OFFLINE, 10.0)
    assert offline.without_hub_s == 8.0, "it was away before the gateway was"
    restarted = offline.lost("gone", 20.0).reported(
        report(replace(OFFLINE, state_age_ms=0), instance_id="b"), 30.0
    )
    assert restarted.without_hub_s == 8.0
    assert restarted.reported(report(), 31.0).without_hub_s is None


def test_dropping_is_noticed_from_one_report_to_the_next() -> None:
    first = view(connected(events_dropped=5), 10.0)
    assert first.dropped_s is None, "it may be long ago"
    assert first.reported(report(connected(events_dropped=5)), 11.0).dropped_s is None
    drops = first.reported(report(connected(events_dropped=6)), 12.0)
    assert drops.dropped_s == 12.0
    emptied = drops.reported(report(connected(events_dropped=0)), 13.0)
    assert emptied.dropped_s == 12.0
    assert emptied.reported(report(connected(events_dropped=1)), 14.0).dropped_s == 14.0
