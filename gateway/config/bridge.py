"""`bridge`: the robot's connection to its fleet."""

from pathlib import Path

from pydantic import Field

from common.config import Section
from gateway.status.cloud import HubAction


class BridgeSettings(Section):
    """The connection to the bridge, and what the fleet's hub may request of this robot."""

    socket: Path | None = None
    """Unix socket of robot-bridge; None, the default, is a robot that is not set up for a fleet."""
    allowed_requests: tuple[HubAction, ...] = Field(default=(), max_length=len(HubAction))
    """What the gateway carries out for the hub; nothing by default. The bridge has a list of its own."""
