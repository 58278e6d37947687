"""The long run for a minute and a half. Memory and logs, which grow slowly, the long run alone can judge."""

from collections.abc import Iterator
from contextlib import suppress
from itertools import cycle, islice

import pytest

from bench.soak.deployment import Deployment, deployment
from bench.soak.readings import Reading
from bench.soak.robot import FAULTS, Fault, one_round
from console.client import PreviewProfile
from tests.support.waiting import wait_until

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
"""Until all is warm; twice as many follow."""
SETTLED_WITHIN_S = 60.0


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
    def rounds(count: int) -> list[dict[str, Reading]]:
        readings = []
        for fault in islice(cycle(FAULTS), count):
            one_round(robot, PreviewProfile.LOW_BW, fault)
            readings.append(robot.readings())
        return readings

    warm = rounds(ROUNDS)
    most = {
        program: (
            max(each[program].descriptors for each in warm),
            max(each[program].threads for each in warm),
        )
        for program in PROGRAMS
    }
    rounds(2 * ROUNDS)

    def grown() -> dict[str, Reading]:
        return {
            program: now
            for program, now in robot.readings().items()
            if now.descriptors > most[program][0] or now.threads > most[program][1]
        }

    # Strangers' connections, and libsrt's closed sockets, go some seconds later.
    with suppress(AssertionError):
        wait_until(lambda: not grown(), "all has gone", SETTLED_WITHIN_S)
    assert grown() == {}, most
