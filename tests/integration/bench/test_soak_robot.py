"""The long run for a minute and a half. Memory and logs, which grow slowly, the long run alone can judge."""

from collections.abc import Iterator
from itertools import cycle, islice

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
    "robot-tap",
    "robot-recorder",
    "robot-bridge",
}


ROUNDS = 2 * len(FAULTS)
"""Of each of both windows, and before them, until all is warm."""


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


@pytest.mark.timeout(300)
def test_no_program_keeps_descriptors_or_threads_of_what_has_ended(robot: Deployment) -> None:
    readings = []
    for fault in islice(cycle(FAULTS), 3 * ROUNDS):
        one_round(robot, PreviewProfile.LOW_BW, fault)
        readings.append(robot.readings())
    for program in PROGRAMS:
        early, late = (
            [each[program] for each in readings[first : first + ROUNDS]] for first in (ROUNDS, 2 * ROUNDS)
        )
        # The lowest: libsrt keeps closed sockets for some seconds, and several rounds pass in each of these.
        assert min(r.descriptors for r in late) <= min(r.descriptors for r in early), program
        assert min(r.threads for r in late) <= min(r.threads for r in early), program
