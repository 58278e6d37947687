"""Metrics of the robot and of this gateway: what the sources say, and the faults."""

from collections import Counter
from collections.abc import Iterator

from prometheus_client.core import GaugeMetricFamily, Metric

from gateway.metrics.families import PREFIX, gauge, gauges, info
from gateway.status.fault import Severity
from gateway.status.meaning import NumberMeaning, TextMeaning
from gateway.status.snapshot import Snapshot


def of_robot(now: Snapshot) -> Iterator[Metric]:
    """Yields the families."""
    yield from _gateway(now)
    yield from _sources(now)
    yield _numbers(now)
    yield _texts(now)
    yield _faults(now)


def _gateway(now: Snapshot) -> Iterator[Metric]:
    identity, runtime = now.identity, now.gateway
    yield info(
        "build_info", "Always 1.", name=identity.name, version=identity.version, revision=runtime.revision
    )
    yield gauge("uptime_seconds", "Since the gateway started.", runtime.uptime_ms / 1000)
    yield gauge("clients", "Connections that called, or got something, lately.", runtime.client_count)
    yield gauge("robot_ready", "1 when the robot can take work.", now.health.ready)


def _sources(now: Snapshot) -> Iterator[Metric]:
    freshness = {source.spec.name: source.freshness for source in now.sources}
    fresh = {name: float(each.fresh) for name, each in freshness.items()}
    yield gauges("source_fresh", "1 while its newest value can be relied on.", "source", fresh)
    ages_s = {name: each.age_ms / 1000 for name, each in freshness.items() if each.available}
    yield gauges("source_age_seconds", "Age of its newest value; absent before the first.", "source", ages_s)


def _numbers(now: Snapshot) -> Metric:
    """Of the configuration's numbers those that can be relied on."""
    family = GaugeMetricFamily(
        f"{PREFIX}_number",
        "Numbers that the configuration names, each in its unit; absent while stale or unknown.",
        labels=("source", "unit"),
    )
    for source in now.sources:
        meaning, sample = source.spec.meaning, now[source.spec]
        if not isinstance(meaning, NumberMeaning) or sample.value is None or sample.freshness.stale:
            continue
        if sample.value.value is not None:
            family.add_metric((source.spec.name, meaning.unit), sample.value.value)
    return family


def _texts(now: Snapshot) -> Metric:
    """How bad the configuration's texts are, as far as they can be relied on."""
    levels = {}
    for source in now.sources:
        meaning, sample = source.spec.meaning, now[source.spec]
        if not isinstance(meaning, TextMeaning) or sample.value is None or sample.freshness.stale:
            continue
        if sample.value.text is not None:
            severity = meaning.severity(sample.value.text)
            levels[source.spec.name] = severity.rank if severity else 0
    what = "Texts that the configuration names: 0 good, 1 warning, 2 error; absent while stale or unknown."
    return gauges("text_level", what, "source", levels)


def _faults(now: Snapshot) -> Metric:
    active = Counter(fault.condition.severity for fault in now.faults if fault.active)
    return gauges("faults", "Active faults.", "severity", {each.value: active[each] for each in Severity})
