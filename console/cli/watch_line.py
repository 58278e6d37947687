"""A status on one line: for logs and pipes."""

from console.client.results import Freshness, PreviewState, PreviewStatus, Sample, SystemStatus
from console.words import age, plural, quantity, signed


def watch_line(status: SystemStatus) -> str:
    """Health, motion, vision and preview, with ages; stale values say so."""
    odometry = status.odometry
    vision = status.vision
    motion = f"{quantity(odometry.linear_speed_mps, 'm/s', 2)} {signed(odometry.wz_rad_s)} rad/s"
    return "  ".join(
        [
            f"health {status.health.state.value} ({status.health.summary})",
            _part("motion", odometry, motion),
            _part("vision", vision, quantity(vision.consumer_fps, "fps")),
            _preview(status.preview),
            *_faults(status),
        ]
    )


def _faults(status: SystemStatus) -> list[str]:
    """The ids of what is wrong; nothing while all is well."""
    active = [fault.id for fault in status.faults if fault.active]
    return [f"{plural(len(active), 'fault')} ({', '.join(active)})"] if active else []


def _part(label: str, sample: Sample, text: str) -> str:
    match sample.freshness:
        case Freshness.MISSING:
            return f"{label} no data"
        case Freshness.STALE:
            return f"{label} STALE {text} ({age(sample.age_ms)})"
        case Freshness.FRESH:
            return f"{label} {text} ({age(sample.age_ms)})"


def _preview(preview: PreviewStatus) -> str:
    words = f"preview {preview.state.value}"
    if preview.state is PreviewState.FAULTED:
        return f"{words} ({preview.last_error})"
    if preview.state is PreviewState.RUNNING and preview.measured.available:
        measured = preview.measured
        return " ".join(
            [
                words,
                quantity(measured.fps, "fps"),
                quantity(measured.bitrate_kbps, "kbit/s", 0),
                plural(measured.viewer_count, "viewer"),
            ]
        )
    return words
