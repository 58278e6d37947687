"""The metrics by name. docs/metrics.md explains each; a test holds the page and this module together."""

from collections.abc import Iterator
from typing import Final

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily as CounterFamily
from prometheus_client.core import GaugeMetricFamily as Gauge
from prometheus_client.core import HistogramMetricFamily as HistogramFamily
from prometheus_client.core import Metric
from prometheus_client.registry import Collector

from gateway.links.preview.control import PreviewLink
from gateway.metrics.loop_delay import LoopDelay
from gateway.rpc.event_stream import EventStream
from gateway.rpc.interceptors.stats import Stats
from gateway.rpc.ports import SnapshotSource
from gateway.rpc.status_stream import StatusStream
from gateway.status.fault import Severity
from gateway.status.preview import PreviewState, PreviewView
from gateway.status.snapshot import Snapshot

_PREFIX: Final = "robot_gateway"


class GatewayCollector(Collector):
    """Collects all metrics at one instant.

    Args:
        state: where the gauges come from.
        stats: of the calls.
        loop_delay: how late the event loop was.
        status_stream: counts responses that slow readers skipped.
        event_stream: counts gaps of subscribers.
        preview_link: counts failures to connect.
    """

    def __init__(
        self,
        state: SnapshotSource,
        *,
        stats: Stats,
        loop_delay: LoopDelay,
        status_stream: StatusStream,
        event_stream: EventStream,
        preview_link: PreviewLink,
    ) -> None:
        self._state = state
        self._stats = stats
        self._loop_delay = loop_delay
        self._status_stream = status_stream
        self._event_stream = event_stream
        self._preview_link = preview_link
        self._registry = CollectorRegistry()
        self._registry.register(self)

    def text(self) -> bytes:
        """Returns them in Prometheus' text format."""
        return generate_latest(self._registry)

    def describe(self) -> list[Metric]:
        """Returns nothing: without this method, registering would collect."""
        return []

    def collect(self) -> Iterator[Metric]:
        """Yields every family."""
        now = self._state.snapshot()
        yield from _gateway(now)
        yield from self._calls()
        yield from self._streams()
        yield from _sources(now)
        yield _faults(now)
        yield from _preview(now.preview)
        yield Gauge(
            f"{_PREFIX}_preview_link_failures",
            "Failures in a row to connect to the preview service.",
            value=self._preview_link.health.failures,
        )
        yield from _stream(now)

    def _calls(self) -> Iterator[Metric]:
        methods = sorted(self._stats.methods.items())
        ended = CounterFamily(
            f"{_PREFIX}_requests", "Calls that ended, by gRPC code.", labels=("method", "code")
        )
        durations = HistogramFamily(
            f"{_PREFIX}_request_duration_seconds",
            "How long calls took; a stream from its first to its last message.",
            labels=("method",),
        )
        for method, stats in methods:
            for code, count in sorted(stats.ended.items()):
                ended.add_metric((method, code), count)
            if stats.ended:
                durations.add_metric((method,), stats.durations.cumulative(), stats.durations.sum_s)
        yield ended
        yield durations
        delays = self._loop_delay.delays
        yield HistogramFamily(
            f"{_PREFIX}_event_loop_delay_seconds",
            "How much later than requested the event loop woke.",
            buckets=delays.cumulative(),
            sum_value=delays.sum_s,
        )

    def _streams(self) -> Iterator[Metric]:
        streams = Gauge(f"{_PREFIX}_streams", "Open streams.", labels=("method",))
        for method, stats in sorted(self._stats.contract.items()):
            if stats.open:
                streams.add_metric((method,), stats.open)
        yield streams
        yield CounterFamily(
            f"{_PREFIX}_statuses_skipped",
            "Statuses that slow readers did not get, because they got newer ones.",
            value=self._status_stream.skipped,
        )
        yield CounterFamily(
            f"{_PREFIX}_event_gaps", "Times a subscriber missed events.", value=self._event_stream.gaps
        )


def _gateway(now: Snapshot) -> Iterator[Metric]:
    runtime = now.gateway
    build = Gauge(f"{_PREFIX}_build_info", "Always 1.", labels=("name", "version", "revision"))
    build.add_metric((now.identity.name, now.identity.version, runtime.revision), 1)
    yield build
    yield Gauge(f"{_PREFIX}_uptime_seconds", "Since the gateway started.", value=runtime.uptime_ms / 1000)
    clients = runtime.client_count
    yield Gauge(f"{_PREFIX}_clients", "Connections that called, or got something, lately.", value=clients)
    yield Gauge(f"{_PREFIX}_robot_ready", "1 when the robot can take work.", value=float(now.health.ready))


def _sources(now: Snapshot) -> Iterator[Metric]:
    fresh = Gauge(f"{_PREFIX}_source_fresh", "1 while its newest value can be relied on.", labels=("source",))
    age = Gauge(
        f"{_PREFIX}_source_age_seconds",
        "Age of its newest value; absent before the first.",
        labels=("source",),
    )
    for source in now.sources:
        fresh.add_metric((source.name,), float(source.freshness.fresh))
        if source.freshness.available:
            age.add_metric((source.name,), source.freshness.age_ms / 1000)
    yield from (fresh, age)


def _faults(now: Snapshot) -> Metric:
    faults = Gauge(f"{_PREFIX}_faults", "Active faults.", labels=("severity",))
    for severity in Severity:
        count = sum(fault.active and fault.condition.severity is severity for fault in now.faults)
        faults.add_metric((severity.value,), count)
    return faults


def _preview(preview: PreviewView) -> Iterator[Metric]:
    state = Gauge(f"{_PREFIX}_preview_state", "1 for the state it is in.", labels=("state",))
    for each in PreviewState:
        state.add_metric((each.value,), float(preview.state is each))
    yield state
    reachable = float(preview.service_reachable)
    yield Gauge(f"{_PREFIX}_preview_reachable", "1 while its service answers.", value=reachable)
    counters = preview.counters
    for name, what, count in (
        ("starts", "Pipelines started.", counters.starts),
        ("restarts", "Those of them after a fault.", counters.restarts),
        ("faults", "Times it became faulted.", counters.faults),
        ("fallbacks", "Encoders that were passed over for the next one.", counters.fallbacks),
        ("viewers_refused", "Connections of viewers beyond srt.max_viewers.", counters.viewers_refused),
    ):
        yield CounterFamily(f"{_PREFIX}_preview_{name}", what, value=count)


def _stream(now: Snapshot) -> Iterator[Metric]:
    """Of the running preview; nothing while there is none, or while its figures are old."""
    if encoder := now.preview.encoder:
        info = Gauge(
            f"{_PREFIX}_preview_encoder_info",
            "Always 1: which encoder runs, and which was wanted.",
            labels=("encoder", "hardware", "wanted"),
        )
        info.add_metric((encoder.name, str(encoder.hardware).lower(), encoder.wanted), 1)
        yield info
    if stream := now.preview.stream:
        target = stream.target_bitrate_kbps * 1000
        yield Gauge(f"{_PREFIX}_preview_target_bits_per_second", "The encoder's target.", value=target)
    measured = now.preview_measured.value
    if measured is None or now.preview_measured.freshness.stale:
        return
    for name, what, value in (
        ("viewers", "Connected to the stream.", measured.viewer_count),
        ("bits_per_second", "Leaving for each viewer.", measured.bitrate_kbps * 1000),
        ("frames_per_second", "Leaving.", measured.fps),
        ("frame_age_seconds", "Of the newest one that left.", measured.last_frame_age_ms / 1000),
        ("worst_rtt_seconds", "Of all viewers.", _per_thousand(measured.worst_rtt_ms)),
        ("worst_loss_percent", "Of all viewers.", measured.worst_loss_percent),
    ):
        if value is not None:
            yield Gauge(f"{_PREFIX}_preview_{name}", what, value=value)


def _per_thousand(value: float | None) -> float | None:
    return None if value is None else value / 1000
