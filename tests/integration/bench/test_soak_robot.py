"""One round of the long run for each of its faults; what programs keep is judged by the long run alone."""

from collections.abc import Iterator

import pytest

from bench.soak.deployment import Deployment, deployment
from bench.soak.robot import FAULTS, Fault, one_round
from console.client import PreviewProfile

pytestmark = [pytest.mark.ros, pytest.mark.gst]

PROGRAMS = {
    "robot-gateway",
    "robot-preview",
    "robot-drive",
    "robot-drive's worker",
    "robot-recorder",
    "robot-bridge",
}


@pytest.fixture(scope="module")
def robot() -> Iterator[Deployment]:
    with deployment() as running:
        yield running


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
def test_everyone_is_served_beside_a_fault(robot: Deployment, fault: Fault) -> None:
    one_round(robot, PreviewProfile.LOW_BW, fault)


def test_every_program_is_read(robot: Deployment) -> None:
    readings = robot.readings()
    assert set(readings) == PROGRAMS
    assert all(each.resident_mib and each.descriptors and each.threads for each in readings.values())
