"""Faults of the live preview."""

from collections.abc import Iterator
from typing import Final

from gateway.status.faults.fault import Condition, Severity
from gateway.status.preview import Encoder, PreviewState, PreviewView

UNREACHABLE: Final = "preview.unreachable"
FAULTED: Final = "preview.faulted"
FALLBACK: Final = "preview.fallback"
_COMPONENT: Final = "preview"


def preview_faults(preview: PreviewView, active: frozenset[str], *, settled: bool) -> Iterator[Condition]:
    """What is wrong now.

    Args:
        preview: as the gateway knows it.
        active: ids of faults that are active: a preview that tries again has not recovered yet.
        settled: whether the gateway has run long enough for the preview service to have been found.
    """
    if not preview.service_reachable:
        # An operator who wants the preview is told of its silence once, not as a fault of its own as well.
        wanted = preview.state is PreviewState.FAULTED
        if wanted or settled:
            yield Condition(
                UNREACHABLE,
                Severity.ERROR if wanted else Severity.WARNING,
                _COMPONENT,
                "the preview service does not answer: there can be no video",
                "Start or restart robot-preview on the robot; the gateway connects by itself",
            )
    elif preview.state is PreviewState.FAULTED or _tries_again(preview, active):
        yield _faulted(preview.last_error)
    if preview.encoder and preview.encoder.fallback_reason:
        yield _fallback(preview.encoder)


def _tries_again(preview: PreviewView, active: frozenset[str]) -> bool:
    return preview.state is PreviewState.STARTING and FAULTED in active


def _faulted(last_error: str) -> Condition:
    return Condition(
        FAULTED,
        Severity.ERROR,
        _COMPONENT,
        f"the preview does not work: {last_error}" if last_error else "the preview does not work",
        "The robot tries again by itself; to try at once type: robotctl preview on",
    )


def _fallback(encoder: Encoder) -> Condition:
    instead = "" if encoder.hardware else " on the robot's own processor"
    return Condition(
        FALLBACK,
        Severity.WARNING,
        _COMPONENT,
        f"{encoder.name} encodes{instead} instead of {encoder.wanted}: {encoder.fallback_reason}",
        "Type on the robot: robot-preview encoders",
    )
