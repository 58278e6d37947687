"""The whole configuration: one YAML file, overridden by `GATEWAY__...` environment variables."""

from collections.abc import Callable, Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import Final, Literal

from pydantic import Field
from pydantic_settings import SettingsConfigDict

from common.addresses import is_loopback
from common.config import Section, Settings, SettingsConflictError, load
from common.metrics_settings import MetricsSettings, check_metrics
from gateway.config.faults import FaultSettings
from gateway.config.generic_sources import MOST_GENERIC, MOST_TILES
from gateway.config.links import BridgeSettings, PreviewSettings, RecordingSettings, TeleopSettings
from gateway.config.security import SecuritySettings
from gateway.config.serving import (
    DiscoverySettings,
    GrpcSettings,
    LimitSettings,
)
from gateway.config.sources import DEFAULT_SOURCES, SourceSettings
from gateway.status.faults.known import ANY_WORD, known_faults, matches
from gateway.status.snapshot import Rules, SourceRule
from gateway.status.sources import MUX_INPUTS

CONFIG_VARIABLE: Final = "ROBOT_GATEWAY_CONFIG"
"""Environment variable with the path of the file, where the command line has none."""


class PlatformSettings(Section):
    """Sampling of the robot's computer."""

    interval_ms: int = Field(default=1000, ge=100)
    stale_after_ms: int = Field(default=3000, gt=0)
    disk_path: Path = Path("/")
    """A path on the file system whose fill level is reported."""
    interface: str | None = Field(default=None, min_length=1)
    """The network interface that leads to the operator; by default the one of the default route."""


class GatewaySettings(Settings):
    """All settings of the gateway. The defaults suit the first robot."""

    model_config = SettingsConfigDict(env_prefix="GATEWAY__")

    name: str = Field(default="robot-gateway", min_length=1, max_length=64)
    """Name of this robot's gateway for operators."""
    log_level: Literal["debug", "info", "warning", "error"] = "info"
    log_format: Literal["human", "json"] = "human"
    """One line of text, or one JSON object per line."""
    grpc: GrpcSettings = GrpcSettings()
    security: SecuritySettings = SecuritySettings()
    limits: LimitSettings = LimitSettings()
    preview: PreviewSettings = PreviewSettings()
    teleop: TeleopSettings = TeleopSettings()
    recording: RecordingSettings = RecordingSettings()
    bridge: BridgeSettings = BridgeSettings()
    platform: PlatformSettings = PlatformSettings()
    faults: FaultSettings = FaultSettings()
    metrics: MetricsSettings = MetricsSettings()
    discovery: DiscoverySettings = DiscoverySettings()
    sources: tuple[SourceSettings, ...] = DEFAULT_SOURCES
    """An empty list makes a gateway that needs no ROS."""

    def check(self) -> None:
        """Raises a `SettingsConflictError` where values are valid each, but not together."""
        _check_exposure(self)
        _check_discovery(self)
        _check_driving(self)
        _check_sources(self)

    def encrypts_preview(self, address: str) -> bool:
        """Returns whether the stream of a listener has a passphrase.

        By default it does if callers must authenticate, and, unless `security.insecure` is set, wherever
        other machines can reach the listener.

        Args:
            address: where viewers reach the listener; empty if unknown, which counts as any address.
        """
        if self.preview.encrypted is not None:
            return self.preview.encrypted
        if self.security.credentials is not None:
            return True
        return not (self.security.insecure or is_loopback(address))

    def status_rules(self) -> Rules:
        """Returns what the status expects of each source; the mux inputs are shown last."""
        shown = sorted(self.sources, key=lambda source: source.spec in MUX_INPUTS.values())
        rules = {source.spec: SourceRule(source.stale_after_ms, source.required) for source in shown}
        return Rules(rules, self.platform.stale_after_ms, self.faults.ignored_by_health)


def load_settings(path: Path | None, *checks: Callable[[GatewaySettings], None]) -> GatewaySettings:
    """Reads and checks the configuration, each section and all together.

    Args:
        path: of the file.
        checks: further ones, as of `common.config.load`.

    Raises:
        UserError: it can't be read, or something in it is wrong.
    """
    return load(GatewaySettings, path, *checks)


def without_effect(settings: GatewaySettings) -> Iterator[str]:
    """Yields a sentence for each value that is valid and does nothing."""
    known = tuple(known_faults([source.spec for source in settings.sources]))
    for rule in settings.faults.ignored_by_health:
        if not any(matches(rule, fault_id) for fault_id in known):
            meant = get_close_matches(rule, [each for each in known if ANY_WORD not in each], n=1)
            hint = f"; did you mean '{meant[0]}'?" if meant else ""
            yield (
                f"faults.ignored_by_health has no effect for '{rule}': no fault of this configuration has "
                f"that ID, or begins with it{hint}"
            )
    tiles = [source.name for source in settings.sources if source.tile]
    for name in tiles[MOST_TILES:]:
        yield f"sources[].tile has no effect for '{name}': windows show the first {MOST_TILES} tiles alone"


def _check_exposure(settings: GatewaySettings) -> None:
    security = settings.security
    if not (security.insecure or security.guarded or is_loopback(settings.grpc.host)):
        what = "anyone on that network could read and control everything"
        if security.credentials is not None:
            what = "anyone on that network could read tokens and responses (security.tls.enabled is false)"
        raise SettingsConflictError(
            ("grpc", "host"),
            f"grpc.host is {settings.grpc.host}: {what}",
            "Authenticate callers ('robot-gateway credentials init' explains how), use 127.0.0.1 "
            "and a tunnel, or accept it with 'security: {insecure: true}'",
        )
    check_metrics(settings.metrics)


def _check_discovery(settings: GatewaySettings) -> None:
    discovery, host = settings.discovery, settings.grpc.host
    alone = bool(discovery.addresses) and all(map(is_loopback, discovery.addresses))
    if discovery.advertise and is_loopback(host) and not alone:
        raise SettingsConflictError(
            ("discovery", "advertise"),
            f"discovery.advertise announces a gateway that no other machine reaches: grpc.host is {host}",
            "Set grpc.host to 0.0.0.0 (with security.credentials), or leave discovery.advertise out",
        )


def _check_driving(settings: GatewaySettings) -> None:
    if (
        settings.teleop.socket
        and settings.security.credentials is None
        and not settings.teleop.allow_insecure
    ):
        raise SettingsConflictError(
            ("teleop", "socket"),
            "teleop.socket is set without authentication: anyone who reaches the gateway could drive",
            "Authenticate callers ('robot-gateway credentials init' explains how), or accept it with "
            "'teleop: {allow_insecure: true}'",
        )


def _check_sources(settings: GatewaySettings) -> None:
    names = [source.name for source in settings.sources]
    for position, source in enumerate(settings.sources):
        if source.name in names[:position]:
            raise SettingsConflictError(
                ("sources", position),
                f"sources lists '{source.name}' {names.count(source.name)} times",
                "Keep one topic for each kind, and one for each label",
            )
    generic = [position for position, source in enumerate(settings.sources) if source.is_generic]
    if len(generic) > MOST_GENERIC:
        raise SettingsConflictError(
            ("sources", generic[MOST_GENERIC]),
            f"sources lists {len(generic)} generic values, of which a gateway takes {MOST_GENERIC}",
            "Keep those that an operator acts upon",
        )
