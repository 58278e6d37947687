"""`preview`, `teleop`, `recording`, `bridge`: the connections to the robot's other programs."""

from pathlib import Path

from pydantic import Field

from common.config import Section
from common.socket_path import SocketPath
from gateway.status.cloud import HubAction


class PreviewSettings(Section):
    """The connection to the preview service, and from viewers to its stream."""

    socket: SocketPath = Path("/run/robot-gateway/preview.sock")
    """Unix socket of robot-preview."""
    settle_ms: int = Field(default=4000, ge=0, le=60_000)
    """How long SetPreviewMode waits for the requested state before it returns the present one."""
    advertised_host: str | None = Field(default=None, min_length=1)
    """Host of the stream for viewers; by default the address at which the caller reached the gateway."""
    encrypted: bool | None = None
    """Whether each session gets its own passphrase; the preview's configuration sets the key length.
    `GatewaySettings.encrypts_preview` has the default."""


class TeleopSettings(Section):
    """The connection to the drive program, and who may drive how."""

    socket: SocketPath | None = None
    """Unix socket of robot-drive; None, the default, is a gateway through which no one can drive."""
    enabled_at_start: bool = True
    """Whether driving is enabled when the gateway starts; SetTeleopEnabled changes it."""
    line_of_sight: bool = False
    """Permits driving without a picture, slowly (`limits.line_of_sight_mps` of the drive program)."""
    legacy_clients: bool = False
    """Permits SendTeleopCommand: tools without hold-to-run, slowly, 500 ms for each command."""
    allow_insecure: bool = False
    """Accepts that callers are not authenticated: anyone who reaches the gateway may drive the robot."""


class RecordingSettings(Section):
    """The connection to the recorder."""

    socket: SocketPath | None = None
    """Unix socket of robot-recorder; None, the default, is a robot that is not set up for recording."""


class BridgeSettings(Section):
    """The connection to the bridge, and what the fleet's hub may request of this robot."""

    socket: SocketPath | None = None
    """Unix socket of robot-bridge; None, the default, is a robot that is not set up for a fleet."""
    allowed_requests: tuple[HubAction, ...] = Field(default=(), max_length=len(HubAction))
    """What the gateway carries out for the hub; nothing by default. The bridge has a list of its own."""
