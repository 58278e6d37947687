"""Metrics of the preview: its service, its cameras and its stream."""

from collections.abc import Iterator

from prometheus_client.core import Metric

from gateway.metrics.families import counter, gauge, gauges, info
from gateway.status.pictures import Pictures
from gateway.status.preview import CameraState, PreviewState, PreviewView
from gateway.status.snapshot import Snapshot


def of_preview(now: Snapshot, link_failures: int) -> Iterator[Metric]:
    """Yields the families."""
    yield from _service(now.preview)
    yield gauge(
        "preview_link_failures", "Failures in a row to connect to the preview service.", link_failures
    )
    yield from _stream(now)


def _service(preview: PreviewView) -> Iterator[Metric]:
    states = {each.value: float(preview.state is each) for each in PreviewState}
    yield gauges("preview_state", "1 for the state it is in.", "state", states)
    yield gauge("preview_reachable", "1 while its service answers.", preview.service_reachable)
    works = {each.name: float(each.state is not CameraState.FAILED) for each in preview.cameras}
    yield gauges("preview_camera_works", "0 if it is missing or failed when last used.", "camera", works)
    live = {each.name: float(each.state is CameraState.LIVE) for each in preview.cameras}
    yield gauges("preview_camera_live", "1 for the camera that is shown.", "camera", live)
    counters = preview.counters
    yield counter("preview_starts", "Pipelines started.", counters.starts)
    yield counter("preview_restarts", "Those of them after a fault.", counters.restarts)
    yield counter("preview_faults", "Times it became faulted.", counters.faults)
    passed_over = "Encoders that were passed over for the next one."
    yield counter("preview_fallbacks", passed_over, counters.fallbacks)
    beyond = "Connections of viewers beyond srt.max_viewers."
    yield counter("preview_viewers_refused", beyond, counters.viewers_refused)


def _stream(now: Snapshot) -> Iterator[Metric]:
    """Of the running preview; nothing while there is none, or while its figures are old."""
    if encoder := now.preview.encoder:
        yield info(
            "preview_encoder_info",
            "Always 1: which encoder runs, and which was wanted.",
            encoder=encoder.name,
            hardware=str(encoder.hardware).lower(),
            wanted=encoder.wanted,
        )
    if stream := now.preview.stream:
        target = stream.target_bitrate_kbps * 1000
        yield gauge("preview_target_bits_per_second", "The encoder's target.", target)
    measured = now.preview_measured.value
    if measured is None or now.preview_measured.freshness.stale:
        return
    yield gauge("preview_viewers", "Connected to the stream.", measured.viewer_count)
    yield gauge("preview_bits_per_second", "Leaving for each viewer.", measured.bitrate_kbps * 1000)
    yield gauge("preview_frames_per_second", "Leaving.", measured.fps)
    age_s = measured.last_frame_age_ms / 1000
    yield gauge("preview_frame_age_seconds", "Of the newest one that left.", age_s)
    yield from _reported(now.pictures)
    if measured.worst_rtt_ms is not None:
        yield gauge("preview_worst_rtt_seconds", "Of all viewers.", measured.worst_rtt_ms / 1000)
    if measured.worst_loss_percent is not None:
        yield gauge("preview_worst_loss_percent", "Of all viewers.", measured.worst_loss_percent)


def _reported(pictures: Pictures) -> Iterator[Metric]:
    """What viewers report of the pictures they show."""
    yield gauge("preview_reporting_viewers", "That report the picture they show.", pictures.viewer_count)
    by_delivery = {"direct": float(pictures.direct_count), "srt_latency": float(pictures.srt_latency_count)}
    yield gauges("preview_viewers_by_delivery", "That report how they take it.", "delivery", by_delivery)
    if pictures.worst_age_ms is not None:
        worst = "Of the oldest picture that a viewer shows, as viewers report it."
        yield gauge("preview_picture_age_seconds", worst, pictures.worst_age_ms / 1000)
    if pictures.most_given_up is not None:
        most = "The most that a viewer has given up since it connected, as viewers report it."
        yield gauge("preview_most_packets_given_up", most, pictures.most_given_up)
