"""The settings of the bridge; docs/configuration.md describes every key."""

from bridge.config.settings import (
    BridgeSettings,
    CommandSettings,
    GatewaySettings,
    HubSettings,
    OutboxSettings,
)
from bridge.config.uploads import UploadSettings

__all__ = [
    "BridgeSettings",
    "CommandSettings",
    "GatewaySettings",
    "HubSettings",
    "OutboxSettings",
    "UploadSettings",
]
