"""Health beyond the required sources: an active error degrades it, unless it is ignored."""

import pytest

from gateway.status.fault import Condition, Fault, Severity
from gateway.status.freshness import Freshness
from gateway.status.health import HEALTHY, HealthState, RobotHealth, assess

MISSING = Freshness(available=False, stale=False, age_ms=0)


def fault(fault_id: str, severity: Severity = Severity.ERROR, *, active: bool = True) -> Fault:
    condition = Condition(fault_id, severity, "part", f"{fault_id} is broken", "Repair it")
    return Fault(condition, 1.0, 2.0, None if active else 3.0, 1)


def test_an_active_error_degrades_and_the_robot_stays_ready() -> None:
    expected = RobotHealth(HealthState.DEGRADED, "diagnostics.drive is broken", ready=True)
    assert assess([], [fault("diagnostics.drive")]) == expected


def test_further_errors_are_counted() -> None:
    faults = [fault("a"), fault("b"), fault("c"), fault("d", Severity.WARNING)]
    assert assess([], faults).summary == "a is broken (and 2 more)"


@pytest.mark.parametrize(
    "harmless", [fault("a", Severity.WARNING), fault("a", Severity.INFO), fault("a", active=False)]
)
def test_warnings_and_cleared_errors_do_not(harmless: Fault) -> None:
    assert assess([], [harmless]) == HEALTHY


@pytest.mark.parametrize(
    ("ignored", "degrades"),
    [
        ("preview", False),
        ("preview.faulted", False),
        ("preview.fault", True),
        ("prev", True),
        ("preview.faulted.more", True),
    ],
)
def test_what_is_ignored_is_an_id_or_its_beginning_up_to_a_dot(ignored: str, degrades: bool) -> None:
    assert (assess([], [fault("preview.faulted")], [ignored]) != HEALTHY) == degrades


def test_a_required_source_comes_first() -> None:
    health = assess([("odometry", MISSING)], [fault("a")])
    assert health == RobotHealth(HealthState.DEGRADED, "waiting for odometry", ready=False)
