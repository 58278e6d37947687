"""The gateway's settings, one module per section; docs/configuration.md describes every key."""

from gateway.config.faults import FaultSettings
from gateway.config.links import PreviewSettings, TeleopSettings
from gateway.config.security import AuditSettings, SecuritySettings, TlsSettings
from gateway.config.serving import GrpcSettings, LimitSettings
from gateway.config.settings import (
    CONFIG_VARIABLE,
    GatewaySettings,
    PlatformSettings,
    load_settings,
    without_effect,
)
from gateway.config.sources import DEFAULT_SOURCES, SourceSettings

__all__ = [
    "CONFIG_VARIABLE",
    "DEFAULT_SOURCES",
    "AuditSettings",
    "FaultSettings",
    "GatewaySettings",
    "GrpcSettings",
    "LimitSettings",
    "PlatformSettings",
    "PreviewSettings",
    "SecuritySettings",
    "SourceSettings",
    "TeleopSettings",
    "TlsSettings",
    "load_settings",
    "without_effect",
]
