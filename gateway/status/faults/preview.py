"""Faults of the live preview."""

from collections.abc import Iterator
from typing import Final

from gateway.status.fault import Condition, Severity
from gateway.status.preview import CameraState, PreviewState, PreviewView, camera_called, live_camera

UNREACHABLE: Final = "preview.unreachable"
FAULTED: Final = "preview.faulted"
FALLBACK: Final = "preview.fallback"
CAMERA: Final = "preview.camera."
"""And the name of the camera."""
_COMPONENT: Final = "preview"


def preview_faults(preview: PreviewView, active: frozenset[str], *, settled: bool) -> Iterator[Condition]:
    """Yields the present conditions.

    Args:
        preview: the state to examine.
        active: ids of the active faults: a preview or a camera that is starting again has not recovered yet.
        settled: whether the startup grace has elapsed.
    """
    if not preview.service_reachable:
        # While the preview is requested, its own state is FAULTED: one fault, not two.
        requested = preview.state is PreviewState.FAULTED
        if requested or settled:
            yield Condition(
                UNREACHABLE,
                Severity.ERROR if requested else Severity.WARNING,
                _COMPONENT,
                "the preview service does not answer: video is not available",
                "Start or restart robot-preview on the robot; the gateway connects by itself",
            )
    elif preview.state is PreviewState.FAULTED or (
        preview.state is PreviewState.STARTING and FAULTED in active
    ):
        yield Condition(
            FAULTED,
            Severity.ERROR,
            _COMPONENT,
            "the preview does not work" + (f": {preview.last_error}" if preview.last_error else ""),
            "The robot retries by itself; to retry at once type: robotctl preview on",
        )
    wanted, live = camera_called(preview.wanted_camera, preview.cameras), live_camera(preview.cameras)
    fails = {CameraState.FAILED}
    if CAMERA + preview.wanted_camera in active:
        fails.add(CameraState.STARTING)  # It is tried again.
    if preview.state is PreviewState.RUNNING and wanted and wanted.state in fails:
        instead = f", and camera {live.name} is shown instead" if live else ""
        reason = f": {wanted.error}" if wanted.error else ""
        yield Condition(
            CAMERA + wanted.name,
            Severity.WARNING,
            _COMPONENT,
            f"camera {wanted.name} does not work{instead}{reason}",
            f"The robot retries by itself; to retry at once type: robotctl preview on --camera {wanted.name}",
        )
    encoder = preview.encoder
    if encoder and encoder.fallback_reason:
        in_software = "" if encoder.hardware else " on the robot's own processor"
        yield Condition(
            FALLBACK,
            Severity.WARNING,
            _COMPONENT,
            f"{encoder.name} encodes{in_software} instead of {encoder.wanted}: {encoder.fallback_reason}",
            "Type on the robot: robot-preview encoders"
            if encoder.hardware
            else "No hardware encoder here? Set encoders.order: [x264] in the preview's configuration. "
            "Else type on the robot: robot-preview encoders",
        )
