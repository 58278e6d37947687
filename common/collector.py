"""Metrics that are collected when they are scraped: all at one instant, none kept in between."""

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import Metric
from prometheus_client.registry import Collector


class InstantCollector(Collector):
    """A collector that a page of metrics is made of; a subclass yields the families in `collect`."""

    def text(self) -> bytes:
        """Returns them in Prometheus' text format."""
        registry = CollectorRegistry()
        registry.register(self)
        return generate_latest(registry)

    def describe(self) -> list[Metric]:
        """Returns nothing: without this method, registering would collect."""
        return []
