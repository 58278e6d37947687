"""The live preview, from the contract's messages."""

from console.client.mapping import enums
from console.client.mapping.values import number, number_when, sample, when
from console.client.results import (
    Encoder,
    PreviewCounters,
    PreviewMeasurement,
    PreviewStatus,
    StreamEndpoint,
    VideoFormat,
)
from omniseer.gateway.v1 import preview_pb2 as wire


def preview(message: wire.PreviewStatus) -> PreviewStatus:
    """Returns the live preview's status."""
    return PreviewStatus(
        state=enums.preview_state(message.state),
        profile=enums.preview_profile(message.profile),
        last_error=message.last_error,
        endpoint=_endpoint(message.endpoint) if message.HasField("endpoint") else None,
        encoder=_encoder(message.encoder) if message.HasField("encoder") else None,
        video=_video(message.video) if message.HasField("video") else None,
        target_bitrate_kbps=message.target_bitrate_kbps,
        bitrate_reason=message.bitrate_reason,
        measured=_measured(message.measured),
        counters=_counters(message.counters),
        service_reachable=message.service_reachable,
    )


def _endpoint(message: wire.StreamEndpoint) -> StreamEndpoint:
    return StreamEndpoint(
        transport=enums.stream_transport(message.transport),
        host=message.host,
        port=message.port,
        uri=message.uri,
        latency_ms=message.latency_ms,
        codec=enums.video_codec(message.codec),
        container=enums.stream_container(message.container),
        encrypted=message.encrypted,
        passphrase=message.passphrase,
    )


def _encoder(message: wire.EncoderStatus) -> Encoder:
    return Encoder(
        name=message.name,
        hardware=message.hardware,
        wanted=message.wanted,
        fallback_reason=message.fallback_reason,
        codec=enums.video_codec(message.codec),
    )


def _video(message: wire.VideoFormat) -> VideoFormat:
    return VideoFormat(width_px=message.width_px, height_px=message.height_px, fps=number(message.fps))


def _measured(message: wire.StreamMeasurement) -> PreviewMeasurement:
    here = message.available
    return PreviewMeasurement(
        **sample(message),
        fps=number_when(here, message.fps),
        bitrate_kbps=number_when(here, message.bitrate_kbps),
        viewer_count=when(here, message.viewer_count),
        last_frame_age_ms=when(here and message.HasField("last_frame_age_ms"), message.last_frame_age_ms),
        worst_rtt_ms=number_when(here and message.HasField("worst_rtt_ms"), message.worst_rtt_ms),
        worst_loss_percent=number_when(
            here and message.HasField("worst_loss_percent"), message.worst_loss_percent
        ),
    )


def _counters(message: wire.PreviewCounters) -> PreviewCounters:
    return PreviewCounters(
        starts=message.starts,
        restarts=message.restarts,
        faults=message.faults,
        fallbacks=message.fallbacks,
        viewers_refused=message.viewers_refused,
    )
