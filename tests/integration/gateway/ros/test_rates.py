"""Sources as slow and as fast as robots have them, seen through the operator's door."""

import itertools
from pathlib import Path

import pytest

from gateway.config import DEFAULT_SOURCES
from omniseer.gateway.v1.source_pb2 import SOURCE_STATE_RECEIVING, SOURCE_STATE_STALE
from tests.support.gateway_program import gateway_program
from tests.support.ros import simulated_robot
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

PATIENCE_S = 20
LOOKS = 150
"""For three seconds or so."""
TWO_OF_THEM_S = 40
"""Time for two values of one in ten seconds."""


@pytest.mark.usefixtures("ros_domain")
def test_a_thousand_values_a_second_are_one_fresh_value(tmp_path: Path) -> None:
    with simulated_robot(tmp_path, "--odometry-hz", "1000"), gateway_program(tmp_path) as gateway:
        wait_until(lambda: gateway.status().health.ready, "a healthy robot", PATIENCE_S)
        ages_ms: list[int] = []

        def looked_at_long_enough() -> bool:
            ages_ms.append(gateway.status().health.odom_age_ms)
            if gateway.source("odometry").state != SOURCE_STATE_RECEIVING:
                ages_ms.clear()  # the robot's programs stood still
            return len(ages_ms) >= LOOKS

        wait_until(looked_at_long_enough, "so many looks in a row without a gap", 2 * PATIENCE_S)
        # Sampled twenty times a second; a busy machine may be late now and then.
        assert sorted(ages_ms)[len(ages_ms) // 2] <= 100


@pytest.mark.usefixtures("ros_domain")
def test_one_value_in_ten_seconds_is_fresh_for_as_long_as_configured(tmp_path: Path) -> None:
    """The same topic for a limit that suits its rate, and for one that does not."""
    kept = [source.model_dump(mode="json") for source in DEFAULT_SOURCES if source.name != "battery"]
    battery = next(source for source in DEFAULT_SOURCES if source.name == "battery").model_dump(mode="json")
    patient, hasty = tmp_path / "patient", tmp_path / "hasty"
    patient.mkdir()
    hasty.mkdir()
    with (
        simulated_robot(tmp_path, "--battery-hz", "0.1"),
        gateway_program(patient, sources=[*kept, {**battery, "stale_after_ms": 15_000}]) as well,
        gateway_program(hasty, sources=[*kept, {**battery, "stale_after_ms": 1_000}]) as worried,
    ):
        wait_until(lambda: well.source("battery").available, "the first value", PATIENCE_S)
        wait_until(lambda: worried.source("battery").state == SOURCE_STATE_STALE, "it is stale", PATIENCE_S)
        ages_ms: list[int] = []

        def aged_and_a_second_came() -> bool:
            source = well.source("battery")
            assert source.state == SOURCE_STATE_RECEIVING
            ages_ms.append(source.age_ms)
            renewed = any(later < earlier for earlier, later in itertools.pairwise(ages_ms))
            return max(ages_ms) > 8_000 and renewed

        wait_until(aged_and_a_second_came, "its age is its own, and a second value", TWO_OF_THEM_S)
