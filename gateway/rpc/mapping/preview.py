"""The live preview as messages of the contract."""

from dataclasses import asdict

from common.addresses import bracketed
from gateway.rpc.calls.recipient import Recipient
from gateway.rpc.mapping.enums import CAMERA_STATES, CODECS, PREVIEW_STATES, PROFILES, delivery_from
from gateway.rpc.mapping.freshness import freshness_fields
from gateway.status.freshness import Sample
from gateway.status.pictures import PictureReport, Pictures
from gateway.status.preview import Camera, Encoder, Listener, Measurement, PreviewView, Stream
from omniseer.gateway.v1 import preview_pb2 as pb
from omniseer.gateway.v1.robot_gateway_pb2 import ReportPictureRequest


def preview_status(
    preview: PreviewView, measured: Sample[Measurement], pictures: Pictures, recipient: Recipient
) -> pb.PreviewStatus:
    """Returns the preview; the passphrase only if the recipient may see it."""
    stream, encoder = preview.stream, preview.encoder
    return pb.PreviewStatus(
        state=PREVIEW_STATES[preview.state],
        profile=PROFILES[preview.profile],
        last_error=preview.last_error,
        endpoint=_endpoint(preview.listener, stream, preview.passphrase, recipient)
        if preview.listener
        else None,
        encoder=_encoder(encoder, stream) if encoder else None,
        video=pb.VideoFormat(width_px=stream.width_px, height_px=stream.height_px, fps=stream.fps)
        if stream
        else None,
        target_bitrate_kbps=stream.target_bitrate_kbps if stream else 0,
        measured=_measured(measured.value, measured, pictures) if measured.value else None,
        counters=pb.PreviewCounters(**asdict(preview.counters)),
        service_reachable=preview.service_reachable,
        bitrate_reason=stream.bitrate_reason if stream else "",
        wanted_camera=preview.wanted_camera,
        cameras=[_camera(camera) for camera in preview.cameras],
    )


def _camera(camera: Camera) -> pb.Camera:
    return pb.Camera(
        name=camera.name, state=CAMERA_STATES[camera.state], error=camera.error, fallback=camera.fallback
    )


def _endpoint(
    listener: Listener, stream: Stream | None, passphrase: str, recipient: Recipient
) -> pb.StreamEndpoint:
    encrypted = bool(passphrase) or (stream is not None and stream.encrypted)
    host = recipient.robot_host
    return pb.StreamEndpoint(
        transport=pb.STREAM_TRANSPORT_SRT,
        host=host,
        port=listener.port,
        uri=f"srt://{bracketed(host)}:{listener.port}?mode=caller&latency={listener.latency_ms}",
        latency_ms=listener.latency_ms,
        codec=CODECS[stream.codec if stream else None],
        container=pb.STREAM_CONTAINER_MPEG_TS,
        passphrase=passphrase if recipient.sees_passphrase else "",
        encrypted=encrypted,
        capture_offset_ns=listener.capture_offset_ns,
    )


def _encoder(encoder: Encoder, stream: Stream | None) -> pb.EncoderStatus:
    return pb.EncoderStatus(
        name=encoder.name,
        hardware=encoder.hardware,
        wanted=encoder.wanted,
        fallback_reason=encoder.fallback_reason,
        codec=CODECS[stream.codec if stream else None],
    )


def picture_report(request: ReportPictureRequest) -> PictureReport:
    """Returns a viewer's report."""
    return PictureReport(
        age_ms=request.picture_age_ms,
        error_ms=request.picture_age_error_ms,
        rtt_ms=request.rtt_ms if request.HasField("rtt_ms") else None,
        loss_percent=request.loss_percent if request.HasField("loss_percent") else None,
        packets_held=request.packets_held,
        packets_given_up=request.packets_given_up,
        delivery=delivery_from(request.delivery),
        link_age_ms=request.link_age_ms if request.HasField("link_age_ms") else None,
    )


def _measured(
    measurement: Measurement, sample: Sample[Measurement], pictures: Pictures
) -> pb.StreamMeasurement:
    return pb.StreamMeasurement(
        **freshness_fields(sample.freshness),
        fps=measurement.fps,
        bitrate_kbps=measurement.bitrate_kbps,
        viewer_count=measurement.viewer_count,
        last_frame_age_ms=measurement.last_frame_age_ms + sample.freshness.age_ms,
        worst_rtt_ms=measurement.worst_rtt_ms,
        worst_loss_percent=measurement.worst_loss_percent,
        worst_picture_age_ms=pictures.worst_age_ms,
        reporting_viewer_count=pictures.viewer_count,
        direct_viewer_count=pictures.direct_count,
        srt_latency_viewer_count=pictures.srt_latency_count,
        most_packets_given_up=pictures.most_given_up,
    )
