"""None harms the others: not a flood the gateway, not the gateway's end the robot."""

import json
import signal
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median

import psutil
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from common import ros_transport
from gateway.config import DEFAULT_SOURCES
from gateway.ros.intake import intake
from gateway.status.board import Board
from gateway.status.sources import DIAGNOSTICS, ODOMETRY
from gateway.status.values import DiagnosticItem, DiagnosticLevel
from tests.support.boards import newest
from tests.support.gateway_program import GatewayProgram, gateway_program
from tests.support.helper import first_line, helper, last_words
from tests.support.ros import simulated_robot
from tests.support.talker import Talker
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.timeout(180)]

ROOT = Path(__file__).parents[4]


def is_healthy(gateway: GatewayProgram) -> bool:
    return bool(gateway.status().health.ready)


@pytest.mark.usefixtures("ros_domain")
def test_a_killed_gateway_costs_the_robots_own_pair_nothing(tmp_path: Path) -> None:
    """A reliable publisher and its subscriber, 200 numbers a second, while gateways come and are killed."""
    with (
        simulated_robot(tmp_path),
        helper("tests.support.pair", "listen") as listener,
        helper("tests.support.pair", "talk") as talker,
    ):
        assert first_line(talker) == "met\n"
        for _ in range(3):
            with gateway_program(tmp_path) as gateway:
                wait_until(partial(is_healthy, gateway), "a healthy robot")
                gateway.process.send_signal(signal.SIGKILL)
                gateway.process.wait(10)
        sent = int(last_words(talker))
        got = json.loads(last_words(listener))
    assert sent > 200
    assert got == list(range(sent))


@dataclass(frozen=True)
class Look:
    """What an operator saw, and how long it took."""

    answered_s: float
    odometry_age_ms: int
    detections_stale: bool


def look(gateway: GatewayProgram) -> Look:
    """One of about forty a second."""
    time.sleep(0.025)
    asked_s = time.monotonic()
    status = gateway.status()
    answered_s = time.monotonic() - asked_s
    stale = next(source.stale for source in status.sources if source.name == "detections")
    return Look(answered_s, status.health.odom_age_ms, stale)


@pytest.mark.timed
@pytest.mark.usefixtures("ros_domain")
def test_a_flood_of_detections_starves_neither_sources_nor_operators(tmp_path: Path) -> None:
    """Thirty pictures a second of five thousand objects each: as much as shared memory carries."""
    with simulated_robot(tmp_path, "--detections-hz", "0"), gateway_program(tmp_path) as gateway:
        wait_until(lambda: gateway.status().health.ready, "a healthy robot")
        with helper("tests.support.flood", "5000", "30") as flood:
            assert first_line(flood) == "ready\n"
            wait_until(lambda: gateway.overlay().detections.detection_count == 5000, "the flood")
            assert len(gateway.overlay().detections.detections) == 100
            looks = [look(gateway) for _ in range(200)]
        # Cut, such a picture costs 2 ms; decoded whole it would hold Python's lock for 70 ms and more.
        assert median(look.odometry_age_ms for look in looks) < 150
        assert median(look.answered_s for look in looks) < 0.05
        assert sum(look.detections_stale for look in looks) < len(looks) / 10


@pytest.mark.usefixtures("ros_domain")
def test_a_flood_is_read_at_the_samplers_pace(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five thousand objects are counted, a hundred are decoded: the source need not rest.

    Through shared memory: of pictures of a megabyte UDP loses as many as its buffers have no room for.
    """
    monkeypatch.delenv(ros_transport.VARIABLE)
    board = Board()
    detections = [source for source in DEFAULT_SOURCES if source.name == "detections"]
    with intake(detections, board) as running, helper("tests.support.flood", "5000", "30") as flood:
        assert first_line(flood) == "ready\n"
        source = running.sources["detections"]
        wait_until(lambda: source.counts.values >= 5, "the flood")
        before, started_s = source.counts.values, time.monotonic()
        wait_until(lambda: source.counts.values >= before + 20, "20 pictures")
        # Decoded whole, 70 ms each and four times as long at rest, they would take 7 s.
        assert time.monotonic() - started_s < 5
        assert source.counts.failures == 0


def test_components_of_many_programs_that_speak_at_once_are_all_heard(talker: Talker) -> None:
    """One topic for all of them: the newest message alone would be the word of one."""
    board = Board()
    diagnostics = [source for source in DEFAULT_SOURCES if source.name == "diagnostics"]
    with intake(diagnostics, board) as running:
        publisher = talker.meet(running, "/diagnostics", DiagnosticArray)
        for number in range(40):
            status = DiagnosticStatus(name=f"component {number}", level=DiagnosticStatus.WARN, message="w")
            publisher.publish(DiagnosticArray(status=[status]))
        wait_until(lambda: (now := board[DIAGNOSTICS]) and len(now.value.items) == 40, "all forty")
        publisher.publish(DiagnosticArray())
        publisher.publish(DiagnosticArray(status=[DiagnosticStatus(name="component 7", message="well")]))
        wait_until(
            lambda: (
                (now := board[DIAGNOSTICS])
                and DiagnosticItem("component 7", DiagnosticLevel.OK, "well") in now.value.items
            ),
            "the newest word of one",
        )
        assert len(newest(board, DIAGNOSTICS).value.items) == 40


def test_ten_thousand_components_leave_a_bounded_number(talker: Talker) -> None:
    board = Board()
    diagnostics = [source for source in DEFAULT_SOURCES if source.name == "diagnostics"]
    with intake(diagnostics, board) as running:
        many = [DiagnosticStatus(name=str(number)) for number in range(10_000)]
        talker.say(running, "/diagnostics", DiagnosticArray(status=many))
        found = wait_until(lambda: board[DIAGNOSTICS], "diagnostics")
        assert [item.component for item in found.value.items] == [str(number) for number in range(256)]
        talker.say(running, "/diagnostics", DiagnosticArray(status=[DiagnosticStatus(name="new")]))
        wait_until(
            lambda: (now := board[DIAGNOSTICS]) and now.value.items[-1].component == "new",
            "the new one",
        )
        assert len(newest(board, DIAGNOSTICS).value.items) == 256


@pytest.mark.usefixtures("ros_domain")
def test_publishers_that_come_and_go_leave_nothing_behind(tmp_path: Path) -> None:
    """A robot of ten publishers restarts again and again; the gateway's threads and files stay as many."""
    board, process = Board(), psutil.Process()
    with intake(DEFAULT_SOURCES, board):

        def once() -> None:
            with simulated_robot(tmp_path):
                wait_until(lambda: (now := board[ODOMETRY]) and time.monotonic() - now.at_s < 0.5, "odometry")
            wait_until(lambda: not any(each.count for each in board.publishers.values()), "an empty graph")

        once()  # what the first robot brings stays: ports, shared memory
        files, threads = process.num_fds(), process.num_threads()
        for _ in range(4):
            once()
        wait_until(lambda: process.num_threads() <= threads, "the threads to end")
        wait_until(lambda: process.num_fds() <= files, "the files to be closed")
