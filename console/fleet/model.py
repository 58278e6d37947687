"""The fleet at one instant, from the hub's list of robots and their newest states. Pure."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from console.client.results import FaultSeverity
from console.fleet.values import Enrolment, FaultBrief, FleetRow, RobotState, Unreadable
from fleet.standing import Evidence, Standing, standing

_MS_PER_S: Final = 1000
_ORDER: Final = (FaultSeverity.INFO, FaultSeverity.UNKNOWN, FaultSeverity.WARNING, FaultSeverity.ERROR)
"""An unknown severity is one of a newer gateway."""


@dataclass(frozen=True, slots=True)
class ReportedState:
    """The newest value of a robot's key in the bucket of states.

    Args:
        content: The state, or why it is none.
        received_unix_ms: When the hub took it, by the hub's clock.
    """

    content: RobotState | Unreadable
    received_unix_ms: int


def fleet_rows(
    enrolled: Mapping[str, Enrolment], states: Mapping[str, ReportedState], now_unix_ms: int
) -> tuple[FleetRow, ...]:
    """Returns a row for each robot that is enrolled or has a state, by name.

    Args:
        enrolled: The hub's list, by robot.
        states: The newest states, by robot.
        now_unix_ms: Now, by the hub's clock.
    """
    names = sorted(enrolled.keys() | states.keys())
    return tuple(_row(name, enrolled.get(name), states.get(name), now_unix_ms) for name in names)


@dataclass(frozen=True, slots=True)
class FleetSummary:
    """The fleet in numbers.

    Args:
        robots: All that are not revoked.
        up: Those whose gateway is up.
        silent: Those that have been seen and are away, or whose gateway does not run.
        with_errors: Those that are up with an active fault of severity error.
        with_warnings: Those of the others with a warning.
        uploads: Recordings that are uploaded or wait for it.
        outbox_events: Events that wait in robots.
        events_dropped: Events that robots had to drop, in all.
    """

    robots: int
    up: int
    silent: int
    with_errors: int
    with_warnings: int
    uploads: int
    outbox_events: int
    events_dropped: int


def summary(rows: tuple[FleetRow, ...]) -> FleetSummary:
    """Returns the fleet in numbers."""
    counted = [row for row in rows if row.standing is not Standing.REVOKED]
    worst = [
        fault.severity if (fault := worst_fault(row.state)) else None
        for row in counted
        if row.standing is Standing.UP and row.state
    ]
    states = [row.state for row in counted if row.state]
    return FleetSummary(
        robots=len(counted),
        up=len(worst),
        silent=sum(row.standing in (Standing.AWAY, Standing.NO_GATEWAY) for row in counted),
        with_errors=worst.count(FaultSeverity.ERROR),
        with_warnings=worst.count(FaultSeverity.WARNING),
        uploads=sum(state.upload_count for state in states),
        outbox_events=sum(state.outbox_events for state in states),
        events_dropped=sum(state.events_dropped for state in states),
    )


def worst_fault(state: RobotState) -> FaultBrief | None:
    """Returns the robot's worst active fault, the first of equals; None without one."""
    return max(state.faults, key=lambda fault: _ORDER.index(fault.severity), default=None)


def _row(name: str, entry: Enrolment | None, seen: ReportedState | None, now_unix_ms: int) -> FleetRow:
    # A clock of the hub that steps back makes no negative ages.
    age_ms = max(0, now_unix_ms - seen.received_unix_ms) if seen else None
    content = seen.content if seen else None
    state = content if isinstance(content, RobotState) else None
    found = standing(
        Evidence(
            enrolled=entry is not None,
            revoked=entry is not None and entry.revoked,
            age_s=None if age_ms is None else age_ms / _MS_PER_S,
            readable=state is not None,
            gateway_reachable=state is not None and state.gateway_reachable,
        )
    )
    return FleetRow(
        robot=name,
        standing=found,
        since_ms=_since_ms(found, entry, state, age_ms, now_unix_ms),
        last_seen_ms=age_ms,
        problem=content.problem if isinstance(content, Unreadable) else "",
        state=state,
    )


def _since_ms(
    found: Standing, entry: Enrolment | None, state: RobotState | None, age_ms: int | None, now_unix_ms: int
) -> int | None:
    if found in (Standing.REVOKED, Standing.NEVER_SEEN):
        begun = entry.since_unix_ms if entry else None
        return None if begun is None else max(0, now_unix_ms - begun)
    if found is Standing.UP and state:
        return state.gateway_uptime_s * _MS_PER_S
    return age_ms if found is Standing.AWAY else None
