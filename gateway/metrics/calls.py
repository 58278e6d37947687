"""Metrics of the operators' calls, their streams and their connections."""

from collections.abc import Iterator

from prometheus_client.core import CounterMetricFamily, HistogramMetricFamily, Metric

from gateway.metrics.families import PREFIX, counter, gauge, gauges
from gateway.metrics.loop_delay import LoopDelay
from gateway.rpc.connections.guard import ConnectionGuard
from gateway.rpc.interceptors.stats import Stats
from gateway.rpc.responses.event_stream import EventStream
from gateway.rpc.responses.status_stream import StatusStream


def of_calls(stats: Stats) -> Iterator[Metric]:
    """Yields how many calls ended, and how long they took."""
    ended = CounterMetricFamily(
        f"{PREFIX}_requests", "Calls that ended, by gRPC code.", labels=("method", "code")
    )
    durations = HistogramMetricFamily(
        f"{PREFIX}_request_duration_seconds",
        "How long calls took, from arrival to end.",
        labels=("method",),
    )
    for method, each in sorted(stats.methods.items()):
        for code, count in sorted(each.ended.items()):
            ended.add_metric((method, code), count)
        if each.ended:
            durations.add_metric((method,), each.durations.cumulative(), each.durations.sum_s)
    yield ended
    yield durations


def of_event_loop(delay: LoopDelay) -> Metric:
    """Returns how late the event loop was."""
    return HistogramMetricFamily(
        f"{PREFIX}_event_loop_delay_seconds",
        "How much later than requested the event loop woke.",
        buckets=delay.delays.cumulative(),
        sum_value=delay.delays.sum_s,
    )


def of_streams(stats: Stats, statuses: StatusStream, events: EventStream) -> Iterator[Metric]:
    """Yields the open streams, and what slow readers of them did not get."""
    open_streams = {name: each.open for name, each in sorted(stats.contract.items()) if each.open}
    yield gauges("streams", "Open streams.", "method", open_streams)
    skipped = "Statuses that slow readers did not get, because they got newer ones."
    yield counter("statuses_skipped", skipped, statuses.skipped)
    yield counter("event_gaps", "Times a subscriber missed events.", events.gaps)


def of_connections(guard: ConnectionGuard) -> Iterator[Metric]:
    """Yields the connections, and what is done against those on which no call is admitted."""
    yield gauge("connections", "Connections to the operators' port.", guard.open)
    yield counter(
        "connections_closed", "Connections closed because no call of theirs was admitted.", guard.closed
    )
    throttled = "Connections throttled because they sent much without an admitted call."
    yield counter("connections_throttled", throttled, guard.throttled)
    muted = "Connections muted because they sent too much without an admitted call."
    yield counter("connections_muted", muted, guard.muted)
    blocked = "Addresses from which no connection is accepted at present."
    yield gauge("addresses_blocked", blocked, len(guard.policy.blocked))
    accepted = "Share of the attempts of other strangers to connect that is accepted at present."
    yield gauge("strangers_accepted_ratio", accepted, 1 / guard.policy.one_in)
