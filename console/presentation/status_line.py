"""A status on one line, for logs and pipes."""

from console.client.results import Freshness, PreviewState, PreviewStatus, Sample, SystemStatus
from console.presentation.formatting import age, bit_rate, plural, quantity, signed


def status_line(status: SystemStatus) -> str:
    """Returns health, motion, vision, preview and fault ids, with ages; stale values are marked."""
    odometry, vision = status.odometry, status.vision
    motion = f"{quantity(odometry.linear_speed_mps, 'm/s', 2)} {signed(odometry.wz_rad_s)} rad/s"
    parts = [
        f"health {status.health.state.value} ({status.health.summary})",
        _part("motion", odometry, motion),
        _part("vision", vision, quantity(vision.consumer_fps, "fps")),
        _preview(status.preview),
    ]
    active = [fault.id for fault in status.faults if fault.active]
    if active:
        parts.append(f"{plural(len(active), 'fault')} ({', '.join(active)})")
    return "  ".join(parts)


def _part(label: str, sample: Sample, text: str) -> str:
    match sample.freshness:
        case Freshness.MISSING:
            return f"{label} no data"
        case Freshness.STALE:
            return f"{label} STALE {text} ({age(sample.age_ms)})"
        case Freshness.FRESH:
            return f"{label} {text} ({age(sample.age_ms)})"


def _preview(preview: PreviewStatus) -> str:
    text = f"preview {preview.state.value}"
    if preview.state is PreviewState.FAULTED:
        return f"{text} ({preview.last_error})"
    if preview.state is PreviewState.RUNNING and preview.measured.available:
        measured = preview.measured
        fps, bitrate = quantity(measured.fps, "fps"), bit_rate(measured.bitrate_kbps)
        return f"{text} {fps} {bitrate} {plural(measured.viewer_count, 'viewer')}"
    return text
