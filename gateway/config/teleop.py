"""`teleop`: driving by operators, through the drive program."""

from pathlib import Path

from common.config import Section


class TeleopSettings(Section):
    """The connection to the drive program, and who may drive how."""

    socket: Path | None = None
    """Unix socket of robot-drive; None, the default, is a gateway through which no one can drive."""
    enabled_at_start: bool = True
    """Whether driving is enabled when the gateway starts; SetTeleopEnabled changes it."""
    line_of_sight: bool = False
    """Permits driving without a picture, slowly (`limits.line_of_sight_mps` of the drive program)."""
    legacy_clients: bool = False
    """Permits SendTeleopCommand: tools without hold-to-run, slowly, 500 ms for each command."""
    allow_insecure: bool = False
    """Accepts that callers are not authenticated: anyone who reaches the gateway may drive the robot."""
