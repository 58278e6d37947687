"""What Prometheus scrapes of the camera tap: its counts by topic."""

from collections.abc import Iterator
from typing import Any

from prometheus_client.core import CounterMetricFamily, Metric

from common.collector import InstantCollector
from tap.totals import Totals

_FAMILIES = {
    "frames": "Frames handed to the preview.",
    "bytes": "Bytes of those frames.",
    "stamps_replaced": "Frames whose stamp could not be their capture time.",
    "connections": "Connections of the preview.",
}


class TapMetrics(InstantCollector):
    """Collects the counts.

    Args:
        totals: the counts.
    """

    def __init__(self, totals: Totals) -> None:
        self._totals = totals

    def collect(self) -> Iterator[Metric]:
        """Yields the families."""
        topics = self._totals.as_dict()
        for name, text in _FAMILIES.items():
            yield _family(name, text, [((topic,), counts[name]) for topic, counts in topics.items()])
        yield _family(
            "refused",
            "Messages that can't be shown, by reason.",
            [
                ((topic, reason), count)
                for topic, counts in topics.items()
                for reason, count in counts["refused"].items()
            ],
            ["topic", "reason"],
        )


def _family(
    name: str, text: str, values: list[tuple[tuple[str, ...], Any]], labels: list[str] | None = None
) -> Metric:
    family = CounterMetricFamily(f"robot_tap_{name}", text, labels=labels or ["topic"])
    for each, value in values:
        family.add_metric(list(each), value)
    return family
