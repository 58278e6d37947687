"""The gateway program itself."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class GatewayFacts:
    """Facts about the gateway program in every status. None where an older gateway does not report them."""

    revision: str | None
    """The git revision it was built from. None also where its build does not record it."""
    boot_id: str | None
    """Kernel boot ID of the robot's computer."""
    uptime_ms: int | None
    client_count: int | None
    """Connections with a call during the last 10 s."""
    requests_served: int | None
    requests_refused: int | None
    run_id: str | None
    """Identifies the run of the gateway program; event numbers start again with each."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodCounts:
    """Counts of one method's calls since the gateway started."""

    method: str
    served: int
    refused: int
    failed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class GatewayInfo:
    """Build, call counts and configuration of the gateway program."""

    gateway_name: str
    gateway_version: str
    gateway: GatewayFacts
    wall_clock_unix_ms: int
    """Time on the robot's wall clock, in ms since 1970 UTC."""
    methods: tuple[MethodCounts, ...]
    configuration_json: str
    """The configuration in force, without secrets."""
