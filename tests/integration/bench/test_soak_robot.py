"""The long run for a minute and a half.

Memory and logs grow slowly, which the long run alone can judge; here they stay within the bounds of
compose.yaml.
"""

import re
import time
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from itertools import cycle, islice
from pathlib import Path
from typing import Any

import pytest
import yaml

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

LOG_COVERS_S = 3600.0
"""Of what happened, at the least, the files that Docker keeps of a program's log have this much."""

Most = dict[str, tuple[int, int]]
"""Descriptors and threads, by program."""


@pytest.fixture(scope="module")
def robot() -> Iterator[Deployment]:
    with deployment() as running:
        yield running


class WarmUp:
    """The first rounds, one beside each fault, that the tests of the faults and the warm-up share.

    Attributes:
        readings: after each of them, and before the first.
        took_s: all of them.
    """

    def __init__(self, robot: Deployment) -> None:
        self._robot = robot
        self._over = set[Fault]()
        self.readings: list[dict[str, Reading]] = []
        self.took_s = 0.0

    def run(self, fault: Fault) -> None:
        """Runs the round beside a fault, unless it is over."""
        if fault in self._over:
            return
        if not self.readings:
            self.readings.append(self._robot.readings())
        began_s = time.monotonic()
        try:
            one_round(self._robot, PreviewProfile.LOW_BW, fault)
        finally:
            self.took_s += time.monotonic() - began_s
        self.readings.append(self._robot.readings())
        self._over.add(fault)


@pytest.fixture(scope="module")
def first_rounds(robot: Deployment) -> WarmUp:
    return WarmUp(robot)


@pytest.fixture(scope="module")
def warm_up(first_rounds: WarmUp) -> WarmUp:
    """All of them."""
    for fault in FAULTS:
        first_rounds.run(fault)
    return first_rounds


def compose() -> dict[str, Any]:
    document = (Path(__file__).parents[3] / "compose.yaml").read_text(encoding="utf-8")
    return dict(yaml.safe_load(document)["services"])


def together_mib(processes: list[Reading]) -> float:
    """Resident memory of processes, with what they share counted once: at least so much."""
    own = sum(each.resident_mib - each.shared_mib for each in processes)
    return own + max(each.shared_mib for each in processes)


def mib(text: str) -> int:
    """Of a size as compose.yaml has it, with the variable that may replace it or without: 10m."""
    found = re.search(r"(\d+)m\}?$", text)
    assert found, text
    return int(found[1])


# Before the warm-up: what is started anew is cold again.
@pytest.mark.parametrize("fault", DEATHS, ids=lambda fault: fault.__name__)
def test_everyone_is_served_beside_a_death(robot: Deployment, fault: Fault) -> None:
    one_round(robot, PreviewProfile.LOW_BW, fault)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
def test_everyone_is_served_beside_a_fault(first_rounds: WarmUp, fault: Fault) -> None:
    first_rounds.run(fault)


def test_every_program_is_read(robot: Deployment) -> None:
    readings = robot.readings()
    assert set(readings) == PROGRAMS
    assert all(each.resident_mib and each.descriptors and each.threads for each in readings.values())


@pytest.mark.timeout(600)
@pytest.mark.parametrize("service", ["gateway", "preview", "drive", "tap", "recorder", "bridge"])
def test_its_memory_is_less_than_its_container_has(warm_up: WarmUp, service: str) -> None:
    """The drive program is two processes in one container, which has their common code once."""
    processes = [name for name in PROGRAMS if name.startswith(f"robot-{service}")]
    most = max(together_mib([each[name] for name in processes]) for each in warm_up.readings)
    print(f"robot-{service}: {most:.0f} MiB")
    assert 0 < most < mib(compose()[service]["mem_limit"])


@pytest.mark.timeout(600)
@pytest.mark.parametrize("service", ["gateway", "preview", "drive", "tap", "recorder", "bridge"])
def test_the_kept_log_covers_an_hour_of_faults(warm_up: WarmUp, service: str) -> None:
    kept = compose()[service]["logging"]["options"]
    # The newest file may have just been begun.
    kept_bytes = mib(kept["max-size"]) * (int(kept["max-file"]) - 1) * 1_000_000
    first, last = (readings[f"robot-{service}"].logged_bytes for readings in warm_up.readings[::ROUNDS])
    per_s = (last - first) / warm_up.took_s
    print(f"robot-{service}: {per_s:.0f} bytes a second")
    assert per_s < kept_bytes / LOG_COVERS_S


@pytest.mark.timeout(600)
def test_no_program_keeps_descriptors_or_threads_of_what_has_ended(
    robot: Deployment, warm_up: WarmUp
) -> None:
    most = most_of(warm_up.readings[1:])
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
