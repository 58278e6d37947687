"""The long run for a minute and a half. Memory and logs, which grow slowly, the long run alone can judge."""

from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from itertools import cycle, islice

import pytest

from bench.soak.deployment import Deployment, deployment
from bench.soak.faults import DEATHS, FAULTS, Fault
from bench.soak.readings import Reading
from bench.soak.robot import one_round
from console.client import PreviewProfile
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.gst, pytest.mark.timed, pytest.mark.alone]
"""Every call of an operator has the client's own deadline, 2 s, while all programs of a robot run."""

PROGRAMS = {
    "robot-gateway",
    "robot-preview",
    "robot-drive",
    "robot-drive's worker",
    "robot-tap",
    "robot-recorder",
    "robot-bridge",
}


ROUNDS = len(FAULTS)
"""Until all is warm; a span is twice as many."""
SPANS = 3
"""In each of which a leak adds something. A pool of threads takes one more at any time, until its bound: one
job in some hundreds is submitted before the thread that has ended the one before it says that it is idle."""
SETTLED_WITHIN_S = 60.0

Most = dict[str, tuple[int, int]]
"""Descriptors and threads, by program."""


@pytest.fixture(scope="module")
def robot() -> Iterator[Deployment]:
    with deployment() as running:
        yield running


@pytest.mark.parametrize("fault", [*FAULTS, *DEATHS], ids=lambda fault: fault.__name__)
def test_everyone_is_served_beside_a_fault(robot: Deployment, fault: Fault) -> None:
    one_round(robot, PreviewProfile.LOW_BW, fault)


def test_every_program_is_read(robot: Deployment) -> None:
    readings = robot.readings()
    assert set(readings) == PROGRAMS
    assert all(each.resident_mib and each.descriptors and each.threads for each in readings.values())


@pytest.mark.timeout(600)
def test_no_program_keeps_descriptors_or_threads_of_what_has_ended(robot: Deployment) -> None:
    most = most_of(rounds(robot, ROUNDS))
    spans: list[dict[str, Reading]] = []
    for _ in range(SPANS):
        rounds(robot, 2 * ROUNDS)
        # Strangers' connections, and libsrt's closed sockets, go some seconds later.
        with suppress(AssertionError):
            wait_until(partial(has_not_grown, robot, most), "all has gone", SETTLED_WITHIN_S)
        now = robot.readings()
        spans.append(grown(now, most))
        if not spans[-1]:
            return
        most = {program: larger(most[program], now[program]) for program in PROGRAMS}
    pytest.fail(f"the programs kept more in every span: {spans}")


def rounds(robot: Deployment, count: int) -> list[dict[str, Reading]]:
    readings = []
    for fault in islice(cycle(FAULTS), count):
        one_round(robot, PreviewProfile.LOW_BW, fault)
        readings.append(robot.readings())
    return readings


def most_of(readings: list[dict[str, Reading]]) -> Most:
    most = dict.fromkeys(PROGRAMS, (0, 0))
    for each in readings:
        most = {program: larger(most[program], each[program]) for program in PROGRAMS}
    return most


def larger(most: tuple[int, int], now: Reading) -> tuple[int, int]:
    descriptors, threads = most
    return max(descriptors, now.descriptors), max(threads, now.threads)


def grown(readings: dict[str, Reading], most: Most) -> dict[str, Reading]:
    return {name: now for name, now in readings.items() if larger(most[name], now) != most[name]}


def has_not_grown(robot: Deployment, most: Most) -> bool:
    return not grown(robot.readings(), most)
