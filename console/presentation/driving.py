"""How driving reads for people: the phase, who drives, and why the robot does not move."""

from typing import Final

from console.client.drive_reasons import SENTENCES, stopped_by
from console.client.results import DriveInhibit, DrivePhase, Teleop
from console.presentation.formatting import joined
from console.presentation.severity_style import DRIVE_STYLES, SeverityStyle

_MOVES_AGAIN: Final = "release, and hold again"


def driving_mark(teleop: Teleop) -> tuple[str, SeverityStyle]:
    """Returns the word for the state of driving, and its style."""
    if DriveInhibit.DRIVE_LOST in teleop.inhibits:
        return "lost", SeverityStyle.WARNING
    if teleop.phase is DrivePhase.UNKNOWN:
        # An older gateway does not report its phase.
        return teleop.state.value, SeverityStyle.GOOD if teleop.enabled else SeverityStyle.QUIET
    return teleop.phase.value, DRIVE_STYLES[teleop.phase]


def driving_text(teleop: Teleop) -> str:
    """Returns who drives, or what keeps the robot from being driven and what to do; empty if all is said."""
    drives = f"{teleop.holder} drives" if teleop.holder else ""
    if stop := teleop.stop:
        return joined(stopped_by(stop), drives, f"type: robotctl reset-stop {stop.stop_id}")
    disabled = teleop.phase is DrivePhase.DISABLED and DriveInhibit.DRIVE_LOST not in teleop.inhibits
    enabling = "type: robotctl drive --enable" if disabled else ""
    if teleop.inhibits:
        reasons = (SENTENCES[inhibit] for inhibit in teleop.inhibits)
        holds = _MOVES_AGAIN if teleop.phase is DrivePhase.INHIBITED else ""
        return joined(drives, *reasons, holds, enabling)
    if enabling:
        return enabling
    return drives or ("no one drives" if teleop.phase is DrivePhase.AVAILABLE else "")
