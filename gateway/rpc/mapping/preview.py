"""The live preview as messages of the contract."""

from typing import Final

from common.bind import bracketed
from gateway.rpc.mapping.enums import CODECS, PREVIEW_STATES, PROFILES
from gateway.rpc.mapping.freshness import freshness_fields
from gateway.rpc.recipient import Recipient
from gateway.status.freshness import Sample
from gateway.status.preview import Counters, Encoder, Listener, Measurement, PreviewView, Stream
from omniseer.gateway.v1 import preview_pb2 as pb

_NO_STREAM: Final = Stream(
    width_px=0,
    height_px=0,
    fps=0.0,
    target_bitrate_kbps=0,
    codec=None,
    encrypted=False,
    bitrate_reason="",
)


def preview_status(
    preview: PreviewView, measured: Sample[Measurement], recipient: Recipient
) -> pb.PreviewStatus:
    """Returns the preview; the passphrase only if the recipient may see it."""
    stream = preview.stream or _NO_STREAM
    encoder = preview.encoder
    return pb.PreviewStatus(
        state=PREVIEW_STATES[preview.state],
        profile=PROFILES[preview.profile],
        last_error=preview.last_error,
        endpoint=_endpoint(preview.listener, stream, preview.passphrase, recipient)
        if preview.listener
        else None,
        encoder=_encoder(encoder, stream) if encoder else None,
        video=_video(preview.stream) if preview.stream else None,
        target_bitrate_kbps=stream.target_bitrate_kbps,
        measured=_measured(measured.value, measured) if measured.value else None,
        counters=_counters(preview.counters),
        service_reachable=preview.service_reachable,
        bitrate_reason=stream.bitrate_reason,
    )


def _endpoint(listener: Listener, stream: Stream, passphrase: str, recipient: Recipient) -> pb.StreamEndpoint:
    encrypted = stream.encrypted or bool(passphrase)
    host = recipient.robot_host
    return pb.StreamEndpoint(
        transport=pb.STREAM_TRANSPORT_SRT,
        host=host,
        port=listener.port,
        uri=f"srt://{bracketed(host)}:{listener.port}?mode=caller&latency={listener.latency_ms}",
        latency_ms=listener.latency_ms,
        codec=CODECS[stream.codec],
        container=pb.STREAM_CONTAINER_MPEG_TS,
        passphrase=passphrase if recipient.sees_passphrase else "",
        encrypted=encrypted,
    )


def _encoder(encoder: Encoder, stream: Stream) -> pb.EncoderStatus:
    return pb.EncoderStatus(
        name=encoder.name,
        hardware=encoder.hardware,
        wanted=encoder.wanted,
        fallback_reason=encoder.fallback_reason,
        codec=CODECS[stream.codec],
    )


def _video(stream: Stream) -> pb.VideoFormat:
    return pb.VideoFormat(width_px=stream.width_px, height_px=stream.height_px, fps=stream.fps)


def _measured(measurement: Measurement, sample: Sample[Measurement]) -> pb.StreamMeasurement:
    return pb.StreamMeasurement(
        **freshness_fields(sample.freshness),
        fps=measurement.fps,
        bitrate_kbps=measurement.bitrate_kbps,
        viewer_count=measurement.viewer_count,
        last_frame_age_ms=measurement.last_frame_age_ms + sample.freshness.age_ms,
        worst_rtt_ms=measurement.worst_rtt_ms,
        worst_loss_percent=measurement.worst_loss_percent,
    )


def _counters(counters: Counters) -> pb.PreviewCounters:
    return pb.PreviewCounters(
        starts=counters.starts,
        restarts=counters.restarts,
        faults=counters.faults,
        fallbacks=counters.fallbacks,
        viewers_refused=counters.viewers_refused,
    )
