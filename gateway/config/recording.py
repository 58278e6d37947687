"""`recording`: recording on the robot's disk, by the recorder."""

from pathlib import Path

from common.config import Section


class RecordingSettings(Section):
    """The connection to the recorder."""

    socket: Path | None = None
    """Unix socket of robot-recorder; None, the default, is a robot that is not set up for recording."""
