"""Families of metrics with the gateway's prefix."""

from collections.abc import Mapping
from typing import Final

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric

PREFIX: Final = "robot_gateway"


def gauge(name: str, what: str, value: float) -> Metric:
    """Returns a gauge without labels."""
    return GaugeMetricFamily(f"{PREFIX}_{name}", what, value=value)


def gauges(name: str, what: str, label: str, values: Mapping[str, float]) -> Metric:
    """Returns a gauge with a value for each value of its label."""
    return _filled(GaugeMetricFamily(f"{PREFIX}_{name}", what, labels=(label,)), values)


def info(name: str, what: str, /, **labels: str) -> Metric:
    """Returns a gauge that is 1, for the sake of its labels."""
    family = GaugeMetricFamily(f"{PREFIX}_{name}", what, labels=tuple(labels))
    family.add_metric(tuple(labels.values()), 1)
    return family


def counter(name: str, what: str, value: float) -> Metric:
    """Returns a counter without labels."""
    return CounterMetricFamily(f"{PREFIX}_{name}", what, value=value)


def counters(name: str, what: str, label: str, values: Mapping[str, float]) -> Metric:
    """Returns a counter with a value for each value of its label."""
    return _filled(CounterMetricFamily(f"{PREFIX}_{name}", what, labels=(label,)), values)


def _filled(
    family: GaugeMetricFamily | CounterMetricFamily, values: Mapping[str, float]
) -> GaugeMetricFamily | CounterMetricFamily:
    for labelled, value in values.items():
        family.add_metric((labelled,), value)
    return family
