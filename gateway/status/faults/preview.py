"""Faults of the live preview."""

from collections.abc import Iterator
from typing import Final

from gateway.status.fault import Condition, Severity
from gateway.status.preview import Encoder, PreviewState, PreviewView

UNREACHABLE: Final = "preview.unreachable"
FAULTED: Final = "preview.faulted"
FALLBACK: Final = "preview.fallback"
_COMPONENT: Final = "preview"


def preview_faults(preview: PreviewView, active: frozenset[str], *, settled: bool) -> Iterator[Condition]:
    """Yields the present conditions.

    Args:
        preview: the state to examine.
        active: ids of the active faults: a preview that is starting again has not recovered yet.
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
        yield _faulted(preview.last_error)
    if preview.encoder and preview.encoder.fallback_reason:
        yield _fallback(preview.encoder)


def _faulted(last_error: str) -> Condition:
    return Condition(
        FAULTED,
        Severity.ERROR,
        _COMPONENT,
        f"the preview does not work: {last_error}" if last_error else "the preview does not work",
        "The robot retries by itself; to retry at once type: robotctl preview on",
    )


def _fallback(encoder: Encoder) -> Condition:
    in_software = "" if encoder.hardware else " on the robot's own processor"
    return Condition(
        FALLBACK,
        Severity.WARNING,
        _COMPONENT,
        f"{encoder.name} encodes{in_software} instead of {encoder.wanted}: {encoder.fallback_reason}",
        "Type on the robot: robot-preview encoders",
    )
