"""The four styles that a value is presented in, by severity."""

from collections.abc import Mapping
from enum import Enum
from typing import Final

from console.client.results import (
    CloudState,
    DrivePhase,
    FaultSeverity,
    Freshness,
    HealthState,
    PreviewState,
    RecorderState,
)


class SeverityStyle(Enum):
    """Selects a colour. Colour never stands alone: the text beside it says the same."""

    GOOD = "good"
    QUIET = "quiet"
    WARNING = "warning"
    BAD = "bad"


FAULT_STYLES: Final[Mapping[FaultSeverity, SeverityStyle]] = {
    FaultSeverity.ERROR: SeverityStyle.BAD,
    FaultSeverity.WARNING: SeverityStyle.WARNING,
    FaultSeverity.INFO: SeverityStyle.QUIET,
    FaultSeverity.UNKNOWN: SeverityStyle.WARNING,
}
FRESHNESS_STYLES: Final[Mapping[Freshness, SeverityStyle]] = {
    Freshness.FRESH: SeverityStyle.GOOD,
    Freshness.STALE: SeverityStyle.WARNING,
    Freshness.MISSING: SeverityStyle.QUIET,
}
HEALTH_STYLES: Final[Mapping[HealthState, SeverityStyle]] = {
    HealthState.OK: SeverityStyle.GOOD,
    HealthState.DEGRADED: SeverityStyle.WARNING,
    HealthState.UNKNOWN: SeverityStyle.QUIET,
}
PREVIEW_STYLES: Final[Mapping[PreviewState, SeverityStyle]] = {
    PreviewState.RUNNING: SeverityStyle.GOOD,
    PreviewState.STARTING: SeverityStyle.WARNING,
    PreviewState.STOPPING: SeverityStyle.WARNING,
    PreviewState.FAULTED: SeverityStyle.BAD,
    PreviewState.DISABLED: SeverityStyle.QUIET,
    PreviewState.UNKNOWN: SeverityStyle.QUIET,
}
DRIVE_STYLES: Final[Mapping[DrivePhase, SeverityStyle]] = {
    DrivePhase.DISABLED: SeverityStyle.QUIET,
    DrivePhase.AVAILABLE: SeverityStyle.GOOD,
    DrivePhase.ARMED: SeverityStyle.GOOD,
    DrivePhase.DRIVING: SeverityStyle.GOOD,
    DrivePhase.STOPPING: SeverityStyle.GOOD,
    DrivePhase.INHIBITED: SeverityStyle.WARNING,
    DrivePhase.STOPPED: SeverityStyle.BAD,
    DrivePhase.UNKNOWN: SeverityStyle.QUIET,
}
RECORDER_STYLES: Final[Mapping[RecorderState, SeverityStyle]] = {
    RecorderState.RECORDING: SeverityStyle.GOOD,
    RecorderState.STARTING: SeverityStyle.WARNING,
    RecorderState.FINALISING: SeverityStyle.WARNING,
    RecorderState.RECOVERING: SeverityStyle.WARNING,
    RecorderState.FAULTED: SeverityStyle.BAD,
    RecorderState.UNREACHABLE: SeverityStyle.WARNING,
    RecorderState.IDLE: SeverityStyle.QUIET,
    RecorderState.UNKNOWN: SeverityStyle.QUIET,
}
CLOUD_STYLES: Final[Mapping[CloudState, SeverityStyle]] = {
    CloudState.CONNECTED: SeverityStyle.GOOD,
    CloudState.OFFLINE: SeverityStyle.WARNING,
    CloudState.REFUSED: SeverityStyle.BAD,
    CloudState.FAULTED: SeverityStyle.BAD,
    CloudState.UNREACHABLE: SeverityStyle.WARNING,
    CloudState.UNKNOWN: SeverityStyle.QUIET,
}
