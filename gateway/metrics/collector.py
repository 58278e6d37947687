"""The metrics by name. docs/metrics.md explains each; a test holds the page and this module together."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from prometheus_client.core import CounterMetricFamily as CounterFamily
from prometheus_client.core import GaugeMetricFamily as Gauge
from prometheus_client.core import HistogramMetricFamily as HistogramFamily
from prometheus_client.core import Metric

from common.collector import InstantCollector
from gateway.links.bridge.copies import Copies
from gateway.links.bridge.link import BridgeLink
from gateway.links.drive.state import DriveLink
from gateway.links.preview.control import PreviewLink
from gateway.links.recorder.incidents import Incidents
from gateway.links.recorder.link import RecorderLink
from gateway.metrics.loop_delay import LoopDelay
from gateway.rpc.calls.ports import SnapshotSource
from gateway.rpc.connections.guard import ConnectionGuard
from gateway.rpc.hub_requests import HubRequests
from gateway.rpc.interceptors.stats import Stats
from gateway.rpc.responses.event_stream import EventStream
from gateway.rpc.responses.export_stream import ExportStream
from gateway.rpc.responses.status_stream import StatusStream
from gateway.status.cloud import CloudState, CloudView
from gateway.status.fault import Severity
from gateway.status.meaning import NumberMeaning, TextMeaning
from gateway.status.preview import CameraState, PreviewState, PreviewView
from gateway.status.recording import RecorderState, RecorderView
from gateway.status.snapshot import Snapshot
from gateway.status.teleop import DrivePhase, TeleopView

_PREFIX: Final = "robot_gateway"


@dataclass(frozen=True, slots=True)
class RecorderMetrics:
    """What counts recording."""

    link: RecorderLink
    incidents: Incidents
    exports: ExportStream


@dataclass(frozen=True, slots=True)
class BridgeMetrics:
    """What counts the connection to the fleet.

    Attributes:
        copies: None where the robot is not set up for recording.
    """

    link: BridgeLink
    copies: Copies | None
    requests: HubRequests


@dataclass(eq=False)
class GatewayCollector(InstantCollector):
    """Collects all metrics at one instant.

    Attributes:
        state: where the gauges come from.
        stats: of the calls.
        loop_delay: how late the event loop was.
        status_stream: counts responses that slow readers skipped.
        event_stream: counts gaps of subscribers.
        connection_guard: counts connections.
        preview_link: counts failures to connect.
        drive_link: the same; None where the robot is not set up for driving.
        recorder: counts recording; None where the robot is not set up for it.
        bridge: counts what concerns the fleet; None where the robot is not set up for one.
    """

    state: SnapshotSource
    stats: Stats
    loop_delay: LoopDelay
    connection_guard: ConnectionGuard
    status_stream: StatusStream
    event_stream: EventStream
    preview_link: PreviewLink
    drive_link: DriveLink | None = None
    recorder: RecorderMetrics | None = None
    bridge: BridgeMetrics | None = None

    def collect(self) -> Iterator[Metric]:
        """Yields every family."""
        now = self.state.snapshot()
        yield from _gateway(now)
        yield from self._calls()
        yield from self._streams()
        yield from _sources(now)
        yield _numbers(now)
        yield _texts(now)
        yield _faults(now)
        yield from _preview(now.preview)
        failures = self.preview_link.failures
        yield _gauge(
            "preview_link_failures", "Failures in a row to connect to the preview service.", failures
        )
        yield from _stream(now)
        if now.teleop and self.drive_link:
            yield from _driving(now.teleop, self.drive_link.failures)
        if now.recorder and self.recorder:
            yield from _recording(now.recorder, self.recorder)
        if now.cloud and self.bridge:
            yield from _cloud(now.cloud, now.at_s, self.bridge)

    def _calls(self) -> Iterator[Metric]:
        methods = sorted(self.stats.methods.items())
        ended = CounterFamily(
            f"{_PREFIX}_requests", "Calls that ended, by gRPC code.", labels=("method", "code")
        )
        durations = HistogramFamily(
            f"{_PREFIX}_request_duration_seconds",
            "How long calls took, from arrival to end.",
            labels=("method",),
        )
        for method, stats in methods:
            for code, count in sorted(stats.ended.items()):
                ended.add_metric((method, code), count)
            if stats.ended:
                durations.add_metric((method,), stats.durations.cumulative(), stats.durations.sum_s)
        yield ended
        yield durations
        delays = self.loop_delay.delays
        yield HistogramFamily(
            f"{_PREFIX}_event_loop_delay_seconds",
            "How much later than requested the event loop woke.",
            buckets=delays.cumulative(),
            sum_value=delays.sum_s,
        )

    def _streams(self) -> Iterator[Metric]:
        open_streams = {name: each.open for name, each in sorted(self.stats.contract.items()) if each.open}
        yield _gauges("streams", "Open streams.", "method", open_streams)
        skipped = "Statuses that slow readers did not get, because they got newer ones."
        yield _counter("statuses_skipped", skipped, self.status_stream.skipped)
        yield _counter("event_gaps", "Times a subscriber missed events.", self.event_stream.gaps)
        guard = self.connection_guard
        yield _gauge("connections", "Connections to the operators' port.", guard.open)
        yield _counter(
            "connections_closed", "Connections closed because no call of theirs was admitted.", guard.closed
        )
        throttled = "Connections throttled because they sent much without an admitted call."
        yield _counter("connections_throttled", throttled, guard.throttled)
        muted = "Connections muted because they sent too much without an admitted call."
        yield _counter("connections_muted", muted, guard.muted)
        blocked = "Addresses from which no connection is accepted at present."
        yield _gauge("addresses_blocked", blocked, len(guard.policy.blocked))
        accepted = "Share of the attempts of other strangers to connect that is accepted at present."
        yield _gauge("strangers_accepted_ratio", accepted, 1 / guard.policy.one_in)


def _gauge(name: str, what: str, value: float) -> Metric:
    return Gauge(f"{_PREFIX}_{name}", what, value=value)


def _gauges(name: str, what: str, label: str, values: Mapping[str, float]) -> Metric:
    """Returns a gauge with a value for each value of its label."""
    family = Gauge(f"{_PREFIX}_{name}", what, labels=(label,))
    for labelled, value in values.items():
        family.add_metric((labelled,), value)
    return family


def _info(name: str, what: str, /, **labels: str) -> Metric:
    """Returns a gauge that is 1, for the sake of its labels."""
    family = Gauge(f"{_PREFIX}_{name}", what, labels=tuple(labels))
    family.add_metric(tuple(labels.values()), 1)
    return family


def _counter(name: str, what: str, value: float) -> Metric:
    return CounterFamily(f"{_PREFIX}_{name}", what, value=value)


def _gateway(now: Snapshot) -> Iterator[Metric]:
    identity, runtime = now.identity, now.gateway
    yield _info(
        "build_info", "Always 1.", name=identity.name, version=identity.version, revision=runtime.revision
    )
    yield _gauge("uptime_seconds", "Since the gateway started.", runtime.uptime_ms / 1000)
    yield _gauge("clients", "Connections that called, or got something, lately.", runtime.client_count)
    yield _gauge("robot_ready", "1 when the robot can take work.", now.health.ready)


def _sources(now: Snapshot) -> Iterator[Metric]:
    freshness = {source.spec.name: source.freshness for source in now.sources}
    fresh = {name: float(each.fresh) for name, each in freshness.items()}
    yield _gauges("source_fresh", "1 while its newest value can be relied on.", "source", fresh)
    ages_s = {name: each.age_ms / 1000 for name, each in freshness.items() if each.available}
    yield _gauges("source_age_seconds", "Age of its newest value; absent before the first.", "source", ages_s)


def _numbers(now: Snapshot) -> Metric:
    """Of the configuration's numbers those that can be relied on."""
    family = Gauge(
        f"{_PREFIX}_number",
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
    return _gauges("text_level", what, "source", levels)


def _faults(now: Snapshot) -> Metric:
    active = Counter(fault.condition.severity for fault in now.faults if fault.active)
    return _gauges("faults", "Active faults.", "severity", {each.value: active[each] for each in Severity})


def _preview(preview: PreviewView) -> Iterator[Metric]:
    states = {each.value: float(preview.state is each) for each in PreviewState}
    yield _gauges("preview_state", "1 for the state it is in.", "state", states)
    yield _gauge("preview_reachable", "1 while its service answers.", preview.service_reachable)
    works = {each.name: float(each.state is not CameraState.FAILED) for each in preview.cameras}
    yield _gauges("preview_camera_works", "0 if it is missing or failed when last used.", "camera", works)
    live = {each.name: float(each.state is CameraState.LIVE) for each in preview.cameras}
    yield _gauges("preview_camera_live", "1 for the camera that is shown.", "camera", live)
    counters = preview.counters
    yield _counter("preview_starts", "Pipelines started.", counters.starts)
    yield _counter("preview_restarts", "Those of them after a fault.", counters.restarts)
    yield _counter("preview_faults", "Times it became faulted.", counters.faults)
    passed_over = "Encoders that were passed over for the next one."
    yield _counter("preview_fallbacks", passed_over, counters.fallbacks)
    beyond = "Connections of viewers beyond srt.max_viewers."
    yield _counter("preview_viewers_refused", beyond, counters.viewers_refused)


def _driving(teleop: TeleopView, failures: int) -> Iterator[Metric]:
    drive = teleop.drive
    phases = {each.value: float(drive.phase is each) for each in DrivePhase}
    yield _gauges("drive_phase", "1 for the phase of driving.", "phase", phases)
    yield _gauge("drive_reachable", "1 while the drive program answers.", drive.reachable)
    yield _gauge("drive_link_failures", "Failures in a row to connect to the drive program.", failures)
    yield _gauge("drive_leased", "1 while a driver has the lease.", bool(teleop.holder))
    if drive.actual is None:
        return
    # Of the present process of the drive program: they start again with the next, as counters may.
    counters = drive.actual.counters
    yield _counter("drive_commands", "Commands that counted.", counters.commands)
    ignored = "Commands that did not count: repeated, or of another session."
    yield _counter("drive_commands_ignored", ignored, counters.ignored)
    inhibited = "Times that a reason stopped the robot while its driver held."
    yield _counter("drive_inhibited", inhibited, counters.inhibited)
    yield _counter("drive_stops", "Stops.", counters.stops)
    yield _counter("drive_published", "Velocity messages published.", counters.published)
    yield _counter("drive_late_cycles", "Cycles that began more than 5 ms late.", counters.late_cycles)


def _stream(now: Snapshot) -> Iterator[Metric]:
    """Of the running preview; nothing while there is none, or while its figures are old."""
    if encoder := now.preview.encoder:
        yield _info(
            "preview_encoder_info",
            "Always 1: which encoder runs, and which was wanted.",
            encoder=encoder.name,
            hardware=str(encoder.hardware).lower(),
            wanted=encoder.wanted,
        )
    if stream := now.preview.stream:
        target = stream.target_bitrate_kbps * 1000
        yield _gauge("preview_target_bits_per_second", "The encoder's target.", target)
    measured = now.preview_measured.value
    if measured is None or now.preview_measured.freshness.stale:
        return
    yield _gauge("preview_viewers", "Connected to the stream.", measured.viewer_count)
    yield _gauge("preview_bits_per_second", "Leaving for each viewer.", measured.bitrate_kbps * 1000)
    yield _gauge("preview_frames_per_second", "Leaving.", measured.fps)
    age_s = measured.last_frame_age_ms / 1000
    yield _gauge("preview_frame_age_seconds", "Of the newest one that left.", age_s)
    yield _gauge("preview_reporting_viewers", "That report the picture they show.", now.pictures.viewer_count)
    if now.pictures.worst_age_ms is not None:
        worst = "Of the oldest picture that a viewer shows, as viewers report it."
        yield _gauge("preview_picture_age_seconds", worst, now.pictures.worst_age_ms / 1000)
    if measured.worst_rtt_ms is not None:
        yield _gauge("preview_worst_rtt_seconds", "Of all viewers.", measured.worst_rtt_ms / 1000)
    if measured.worst_loss_percent is not None:
        yield _gauge("preview_worst_loss_percent", "Of all viewers.", measured.worst_loss_percent)


def _recording(view: RecorderView, recorder: RecorderMetrics) -> Iterator[Metric]:
    states = {each.value: float(view.status.state is each) for each in RecorderState}
    yield _gauges("recorder_state", "1 for the state it is in.", "state", states)
    failures = recorder.link.failures
    yield _gauge("recorder_link_failures", "Failures in a row to connect to the recorder.", failures)
    yield _gauge("exports", "Exports of recordings that run.", recorder.exports.open)
    yield _counter("exported_bytes", "Bytes sent by exports.", recorder.exports.sent_bytes)
    unreported = "Faults that the recorder could not be given."
    yield _counter("faults_unreported", unreported, recorder.incidents.expired)
    if view.report is None:
        return
    # Of the present process of the recorder, as far as they are counts.
    report = view.report.value
    status = report.status
    yield _gauge("recording_bytes_per_second", "Written at present.", status.bytes_per_s)
    yield _gauge("recording_room_bytes", "May still be written.", status.room_bytes)
    yield _gauge("recordings", "Recordings on the disk.", status.recordings)
    if report.messages_lost is not None:
        lost = "Messages that the middleware lost before the recorder took them."
        yield _counter("recording_messages_lost", lost, report.messages_lost)
    dropped = "Messages dropped because the disk was too slow."
    yield _counter("recording_messages_dropped", dropped, report.messages_dropped)
    yield _gauge("recording_disk_free_bytes", "Free on its file system.", report.disk_free_bytes)
    yield _gauge("recording_disk_size_bytes", "Size of its file system.", report.disk_size_bytes)


def _cloud(view: CloudView, now_s: float, bridge: BridgeMetrics) -> Iterator[Metric]:
    status = view.status(now_s)
    states = {each.value: float(status.state is each) for each in CloudState}
    yield _gauges("cloud_state", "1 for the state of the connection to the fleet's hub.", "state", states)
    failures = bridge.link.failures
    yield _gauge("bridge_link_failures", "Failures in a row to connect to the bridge.", failures)
    answered = CounterFamily(
        f"{_PREFIX}_hub_requests", "Requests of the fleet's hub, by their outcome.", labels=("outcome",)
    )
    for outcome, count in bridge.requests.answered.items():
        answered.add_metric((outcome.value,), count)
    yield answered
    if bridge.copies:
        waiting = "States of copies that the recorder does not have yet."
        yield _gauge("copy_states_waiting", waiting, bridge.copies.waiting)
        dropped = "States of copies that were dropped because too many waited for the recorder."
        yield _counter("copy_states_dropped", dropped, bridge.copies.dropped)
        failed = "Attempts at which the recorder did not take the state of a copy."
        yield _counter("copy_state_failures", failed, bridge.copies.failures)
    if view.newest is None:
        return
    yield _gauge("outbox_events", "Events that wait to be sent to the hub.", status.outbox_events)
    yield _gauge("outbox_bytes", "Size of the outbox.", status.outbox_bytes)
    yield _gauge("outbox_max_bytes", "Its limit.", status.outbox_max_bytes)
    yield _counter("cloud_events_sent", "Events that the hub has acknowledged.", status.events_sent)
    dropped = "Events dropped because the outbox was full or its disk refused."
    yield _counter("cloud_events_dropped", dropped, status.events_dropped)
    if status.last_sent_age_ms is not None:
        age_s = status.last_sent_age_ms / 1000
        yield _gauge("cloud_last_sent_age_seconds", "Age of the newest acknowledgement.", age_s)
    waiting = "Recordings that wait to be copied or are being copied."
    yield _gauge("uploads_waiting", waiting, status.uploads_waiting)
    yield _gauge("upload_bytes_per_second", "Sent of a recording at present.", status.upload_bytes_per_s)
