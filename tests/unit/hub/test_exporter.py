"""The fleet's metrics: of enrolled robots alone, and each of them documented and in the dashboard."""

import json
import re
from pathlib import Path

import pytest
from prometheus_client.parser import text_string_to_metric_families

from hub.exporter.collector import MOST_ROBOTS, MOST_SERIES, FleetCollector
from hub.jetstream.streams import StreamUse
from omniseer.gateway.v1.fault_pb2 import FAULT_SEVERITY_ERROR, FAULT_SEVERITY_WARNING
from omniseer.gateway.v1.value_pb2 import TEXT_LEVEL_ERROR
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
    state.numbers.add(label="motor", unit="°C", available=True, value=61.5)
    state.texts.add(label="arm", available=True, text="jammed", level=TEXT_LEVEL_ERROR)
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
    assert found["number", "a", "number.motor", "°C"] == 61.5
    assert found["text_level", "a", "text.arm"] == 2
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
    found = samples(collector)
    assert sum(labels[0] == "up" for labels in found) == MOST_ROBOTS
    assert found["robots_left_out",] == 5
    report(collector, f"r{MOST_ROBOTS}")
    assert not collector._states, "the state of one that is left out takes no place"
    collector.take_robot(f"r{MOST_ROBOTS}", b"", deleted=True)
    assert samples(collector)["robots_left_out",] == 4


def test_values_that_are_not_known_have_no_metric(collector: FleetCollector) -> None:
    enroll(collector, "a")
    state = healthy_state("a")
    state.numbers.add(label="never")
    state.numbers.add(label="none", available=True)
    state.numbers.add(label="old", available=True, stale=True, value=1)
    state.numbers.add(label="nan", available=True, value=float("nan"))
    state.texts.add(label="newer", available=True, text="x", level=77)
    collector.take_state("a", state.SerializeToString(), NOW, deleted=False)
    assert not {labels for labels in samples(collector) if labels[0] in ("number", "text_level")}


def test_no_robot_fills_prometheus_or_breaks_the_page(collector: FleetCollector) -> None:
    enroll(collector, "a", "b")
    report(collector, "b")
    for start in range(0, 4 * MOST_SERIES, 16):
        state = healthy_state("a")
        for index in range(start, start + 16):
            for value in (1, 2):
                state.numbers.add(label=f"n{index}", available=True, value=value)
        state.numbers.add(label='x"} 1\nrobot_fleet_up{robot="b', available=True, value=1)
        state.numbers.add(label="ok", unit="x" * 500, available=True, value=1)
        collector.take_state("a", state.SerializeToString(), NOW, deleted=False)
        found = [labels for labels in samples(collector) if labels[:2] == ("number", "a")]
        # Names that came later than the first ones are never taken.
        assert all(int(labels[2].removeprefix("number.n")) < MOST_SERIES for labels in found)
        # The same series twice would make Prometheus refuse the page, with all other robots' metrics.
        page = collector.text().decode().splitlines()
        names = [line.rsplit(" ", 1)[0] for line in page if not line.startswith("#")]
        assert len(names) == len(set(names))
    assert samples(collector)["number", "b", "number.motor", "°C"] == 61.5


def test_how_full_the_streams_are(collector: FleetCollector) -> None:
    collector.take_use(StreamUse("fleet_events", 1, 4))
    collector.take_use(StreamUse("fleet_events", 3, 4))
    collector.take_use(StreamUse("without_limit", 3, -1))
    found = samples(collector)
    assert found["stream_used_ratio", "fleet_events"] == 0.75
    assert found["stream_used_ratio", "without_limit"] == 0


def shown(collector: FleetCollector) -> set[str]:
    collector.take_use(StreamUse("fleet_events", 1, 4))
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
