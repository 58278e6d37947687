"""Freshness and health against the plainest model of the same rules."""

from typing import Any, Final

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.config import GatewaySettings
from gateway.config.sources import KINDS, SourceSettings
from gateway.status.board import Board
from gateway.status.freshness import NEVER, Freshness, sample
from gateway.status.health import HealthState, RobotHealth, assess
from gateway.status.snapshot import SourceRule
from gateway.status.sources import ODOMETRY, VISION, SourceSpec
from gateway.status.values import Received, Velocity, Vision
from tests.support.status import snapshot_of

SECONDS = st.floats(min_value=0, max_value=1e7, allow_nan=False)
LIMITS = st.integers(min_value=1, max_value=100_000)


def test_nothing_received_is_not_available_and_has_no_age() -> None:
    assert sample(None, 1000, 12.0).freshness == NEVER


def test_a_value_is_stale_only_when_older_than_the_limit() -> None:
    received = Received("value", 10.0)
    assert sample(received, 1000, 11.0).freshness == Freshness(available=True, stale=False, age_ms=1000)
    assert sample(received, 1000, 11.002).freshness == Freshness(available=True, stale=True, age_ms=1002)


def test_a_value_received_after_the_instant_has_no_negative_age() -> None:
    assert sample(Received("value", 10.5), 1000, 10.0).freshness.age_ms == 0


@given(at_s=SECONDS, passed_s=SECONDS, limit_ms=LIMITS)
def test_age_is_the_time_passed_and_staleness_follows(at_s: float, passed_s: float, limit_ms: int) -> None:
    seen = sample(Received("value", at_s), limit_ms, at_s + passed_s).freshness
    # Whole milliseconds, and the clock's own rounding at large values.
    assert abs(seen.age_ms - passed_s * 1000) <= 1.01
    assert seen.available
    assert seen.stale == (seen.age_ms > limit_ms)


def model(odometry: tuple[bool, float | None], vision: tuple[bool, float | None]) -> str:
    """The contract's sentence, for (required, age in ms or None) of each; limits 1000 and 2000 ms."""
    lines = [
        (odometry, 1000, "waiting for odometry", "odometry stale"),
        (vision, 2000, "waiting for vision telemetry", "vision telemetry stale"),
    ]
    for (required, age_ms), limit_ms, waiting, stale in lines:
        if required and age_ms is None:
            return waiting
        if required and age_ms is not None and age_ms > limit_ms:
            return stale
    return "robot healthy"


AGES = st.none() | st.integers(min_value=0, max_value=5000)


@given(
    odometry_required=st.sampled_from([True, False, None]),
    vision_required=st.sampled_from([True, False, None]),
    odometry_age_ms=AGES,
    vision_age_ms=AGES,
)
def test_health_follows_the_contract_line_by_line(
    odometry_required: bool | None,
    vision_required: bool | None,
    odometry_age_ms: int | None,
    vision_age_ms: int | None,
) -> None:
    """None for "required" is a robot that is configured without the source."""
    now_s = 1000.0
    sources: dict[SourceSpec[Any], SourceRule] = {}
    if odometry_required is not None:
        sources[ODOMETRY] = SourceRule(1000, odometry_required)
    if vision_required is not None:
        sources[VISION] = SourceRule(2000, vision_required)
    # Half a millisecond off, so that no age sits on a rounding edge.
    board = Board()
    if odometry_age_ms is not None:
        board[ODOMETRY] = Received(Velocity(0, 0, 0), now_s - (odometry_age_ms + 0.5) / 1000)
    if vision_age_ms is not None:
        board[VISION] = Received(Vision(0, 0, 0, 0, 0), now_s - (vision_age_ms + 0.5) / 1000)

    health = snapshot_of(board, sources, now_s=now_s).health

    expected = model((odometry_required is True, odometry_age_ms), (vision_required is True, vision_age_ms))
    assert health.summary == expected
    assert health.ready == (expected == "robot healthy")
    assert (health.state is HealthState.OK) == health.ready


def test_a_robot_without_both_sources_is_healthy() -> None:
    assert assess([]) == RobotHealth(HealthState.OK, "robot healthy", ready=True)


WITH_LABELS: Final = {
    "mux_input": {"label": "keyboard"},
    "number": {"label": "motor_temperature", "field": "a"},
    "text": {"label": "gripper", "field": "a"},
}
NAMES: Final = {
    "vision": "vision telemetry",
    "effective_command": "effective command",
    "mux_input": "commands of keyboard",
    "number": "motor temperature",
    "text": "gripper",
}
"""Of sources in the summary, where it is not the kind."""


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("required", [True, False])
@pytest.mark.parametrize(("age_ms", "verdict"), [(None, "waiting for {}"), (999, ""), (1001, "{} stale")])
def test_a_required_source_of_any_kind_decides(
    kind: str, required: bool, age_ms: int | None, verdict: str
) -> None:
    more = WITH_LABELS.get(kind, {})
    source = SourceSettings.model_validate(
        {"kind": kind, "topic": "/a", "type": "n/msg/O", "stale_after_ms": 1000, "required": required, **more}
    )
    rules = GatewaySettings(sources=(source,)).status_rules()
    board, now_s = Board(), 1000.0
    if age_ms is not None:
        # Half a millisecond off, as above. No source's value says anything about its age.
        board[source.spec] = Received(Velocity(0, 0, 0), now_s - (age_ms + 0.5) / 1000)

    health = snapshot_of(board, rules=rules, now_s=now_s).health

    expected = verdict.format(NAMES.get(kind, kind)) if required else ""
    assert health.summary == (expected or "robot healthy")
    assert health.ready == (not expected)
    assert (health.state is HealthState.OK) == (not expected)
