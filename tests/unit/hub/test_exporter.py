"""The fleet's metrics: of enrolled robots alone, and each of them documented and in the dashboard."""

import json
import re
from pathlib import Path

import pytest
from prometheus_client.parser import text_string_to_metric_families

from hub.exporter.collector import MOST_ROBOTS, FleetCollector
from omniseer.gateway.v1.fault_pb2 import FAULT_SEVERITY_ERROR, FAULT_SEVERITY_WARNING
from tests.support.fleet_values import healthy_state, wrong_bytes

ROOT = Path(__file__).parents[3]
NOW = 2_000_000_000_000


@pytest.fixture
def collector() -> FleetCollector:
    return FleetCollector(lambda: NOW, lambda: True)


def enroll(collector: FleetCollector, *names: str, revoked: bool = False) -> None:
    for name in names:
        collector.take_robot(name, json.dumps({"revoked": revoked}).encode(), deleted=False)


def report(collector: FleetCollector, name: str, *, age_ms: int = 1000) -> None:
    state = healthy_state(name)
    state.faults.add(severity=FAULT_SEVERITY_ERROR)
    state.faults.add(severity=FAULT_SEVERITY_WARNING)
    state.outbox_events, state.events_dropped, state.upload_count = 3, 4, 5
    state.uploads.add(bytes_per_s=1000)
    state.uploads.add(bytes_per_s=500)
    collector.take_state(name, state.SerializeToString(), NOW - age_ms, deleted=False)


def samples(collector: FleetCollector) -> dict[tuple[str, ...], float]:
    return {
        (sample.name.removeprefix("robot_fleet_"), *sample.labels.values()): sample.value
        for family in text_string_to_metric_families(collector.text().decode())
        for sample in family.samples
    }


def test_what_a_robot_reports(collector: FleetCollector) -> None:
    enroll(collector, "a")
    report(collector, "a")
    found = samples(collector)
    assert found["up", "a"] == 1
    assert found["last_seen_seconds", "a"] == 1.0
    assert found["ready", "a"] == 1
    assert (found["faults", "a", "error"], found["faults", "a", "warning"], found["faults", "a", "info"]) == (
        1,
        1,
        0,
    )
    assert (found["battery_percent", "a"], found["disk_used_percent", "a"]) == (78, 40)
    assert (found["outbox_events", "a"], found["events_dropped_total", "a"]) == (3, 4)
    assert (found["uploads", "a"], found["upload_bytes_per_second", "a"]) == (5, 1500)
    assert found["hub_connected",] == 1


def test_robots_by_where_they_stand(collector: FleetCollector) -> None:
    enroll(collector, "up", "away", "never", "junk")
    enroll(collector, "old", revoked=True)
    report(collector, "up")
    report(collector, "away", age_ms=31_000)
    report(collector, "old")
    collector.take_state("junk", b"\xff\xff", NOW, deleted=False)
    found = samples(collector)
    standings = {labels[1]: value for labels, value in found.items() if labels[0] == "robots"}
    assert standings == {"up": 1, "away": 1, "never seen": 1, "unreadable": 1, "revoked": 1, "no gateway": 0}
    assert {labels[1]: value for labels, value in found.items() if labels[0] == "up"} == {
        "up": 1,
        "away": 0,
        "never": 0,
        "junk": 0,
    }
    assert ("last_seen_seconds", "never") not in found
    assert ("battery_percent", "junk") not in found


def test_only_enrolled_robots_have_metrics(collector: FleetCollector) -> None:
    before = samples(collector)
    for number, payload in enumerate(wrong_bytes()):
        collector.take_state(f"evil{number}", payload, NOW, deleted=False)
    report(collector, "stranger")
    collector.take_robot('a"} 1\nrobot_fleet_up{robot="b', b"{}", deleted=False)
    assert samples(collector) == before


def test_a_robot_that_is_taken_from_the_list_has_no_metrics(collector: FleetCollector) -> None:
    before = samples(collector)
    enroll(collector, "a")
    report(collector, "a")
    assert samples(collector) != before
    collector.take_robot("a", b"", deleted=True)
    assert samples(collector) == before


def test_the_number_of_robots_is_bounded(collector: FleetCollector) -> None:
    enroll(collector, *(f"r{number}" for number in range(MOST_ROBOTS + 5)))
    assert sum(labels[0] == "up" for labels in samples(collector)) == MOST_ROBOTS


def shown(collector: FleetCollector) -> set[str]:
    enroll(collector, "a")
    report(collector, "a")
    return {f"robot_fleet_{labels[0]}" for labels in samples(collector)}


def test_the_dashboard_queries_exactly_what_there_is(collector: FleetCollector) -> None:
    dashboard = json.loads((ROOT / "deploy/hub/grafana/fleet.json").read_text())
    queries = [target["expr"] for panel in dashboard["panels"] for target in panel["targets"]]
    asked = set(re.findall(r"robot_fleet_\w+", " ".join(queries)))
    assert asked == shown(collector)


def test_the_page_names_exactly_the_metrics(collector: FleetCollector) -> None:
    page = (ROOT / "docs/fleet.md").read_text()
    assert set(re.findall(r"^\| `(robot_fleet_\w+)", page, re.MULTILINE)) == shown(collector)
