"""The gateway program itself."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class GatewayFacts:
    """Small facts that come with every status. None where the gateway is older than they are."""

    revision: str | None
    """The git revision it was built from. None also when its build does not tell."""
    boot_id: str | None
    """Another one after each start of the robot's computer."""
    uptime_ms: int | None
    client_count: int | None
    """Connections that asked for something during the last 10 s."""
    requests_served: int | None
    requests_refused: int | None
    run_id: str | None
    """Another one after each start of the gateway program; it numbers the events."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodCounts:
    """How often one method was called since the gateway started."""

    method: str
    served: int
    refused: int
    failed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class GatewayInfo:
    """What is known of the gateway program."""

    gateway_name: str
    gateway_version: str
    gateway: GatewayFacts
    wall_clock_unix_ms: int
    """What the robot's own calendar clock showed, in ms since 1970 UTC."""
    methods: tuple[MethodCounts, ...]
    configuration_json: str
    """The configuration in force, without secrets."""
