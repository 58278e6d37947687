"""Stops that are repeated: which request has stopped the robot, and what the drive program gets."""

import asyncio
import itertools
import time
from dataclasses import replace
from typing import Any

import pytest

from common.broadcast import Broadcast
from common.errors import DriveUnreachableError, PreconditionError
from gateway.status.teleop import DriveCounters, DrivePhase, DriveView, StopLatch
from gateway.teleop.stops import CONFIRMED_WITHIN_S, COPIES_NS, MOST_COPIES, Copies, Stops
from tests.support.drive_views import actual
from tests.support.virtual_time import in_virtual_time

NOW_NS = 10**15
STOP = StopLatch(stop_id=7, by="anna", reason="", since_ns=NOW_NS)
NEWER = StopLatch(stop_id=8, by="anna", reason="", since_ns=NOW_NS)
ON_ITS_WAY_S = 0.001
"""Of a reset, to the double."""


def copies() -> Copies:
    made = Copies()
    made.confirmed("anna", "one", STOP, NOW_NS)
    return made


def test_a_copy_gets_the_stop_of_the_first() -> None:
    assert copies().first("anna", "one", NOW_NS + 1) == STOP


@pytest.mark.parametrize(("by", "request_id"), [("anna", "two"), ("ben", "one"), ("anna", "")])
def test_any_other_request_is_no_copy(by: str, request_id: str) -> None:
    assert copies().first(by, request_id, NOW_NS + 1) is None


def test_a_request_without_an_id_has_no_copies() -> None:
    made = Copies()
    made.confirmed("anna", "", STOP, NOW_NS)
    assert made.first("anna", "", NOW_NS + 1) is None


def test_an_id_that_is_used_again_and_again_keeps_no_stop_out_for_long() -> None:
    made = copies()
    made.confirmed("anna", "one", STOP, NOW_NS + COPIES_NS // 2)
    assert made.first("anna", "one", NOW_NS + COPIES_NS - 1) == STOP
    assert made.first("anna", "one", NOW_NS + COPIES_NS) is None
    made.confirmed("anna", "one", NEWER, NOW_NS + COPIES_NS)
    assert made.first("anna", "one", NOW_NS + COPIES_NS + 1) == NEWER


def test_many_requests_push_out_the_oldest_which_then_stop_anew() -> None:
    made = copies()
    for number in range(MOST_COPIES - 1):
        made.confirmed("anna", f"another-{number}", NEWER, NOW_NS + 1)
    assert made.first("anna", "one", NOW_NS + 1) == STOP
    made.confirmed("anna", "one-more", NEWER, NOW_NS + 1)
    assert made.first("anna", "one", NOW_NS + 1) is None
    assert made.first("anna", "one-more", NOW_NS + 1) == NEWER


class Drive:
    """A drive program that confirms a stop in the next turn of the event loop, and what it is sent."""

    def __init__(self) -> None:
        self.changes = Broadcast()
        self.view = DriveView(enabled=True, applied=True, error="", actual=actual())
        self.sent: list[str] = []
        self.full = 0
        """So many messages more find the connection full."""
        self.hangs = False
        """Whether it takes stops and does nothing."""
        self.kept = ""
        """Whose stop is not confirmed."""
        self.obstacle = ""
        """Keeps it from resetting stops."""
        self._instance_id = "a process"
        self._numbers = itertools.count(1)
        self._taken = 0

    def stop(self, by: str, reason: str) -> bool:
        self.kept = by
        if self.full:
            self.full -= 1
            return False
        self.sent.append(by)
        if not self.hangs:
            asyncio.get_running_loop().call_soon(self.confirm, by, reason)
        return True

    def stop_confirmed(self) -> None:
        self.kept = ""

    def go(self) -> None:
        """Ends, or loses its connection."""
        self.view = replace(self.view, error="gone")
        self.full = 10**6

    def come_back(self) -> None:
        """Connects as another process, which knows nothing of the one before."""
        self._instance_id, self._taken, self.full = "another process", 0, 0
        self.view = replace(self.view, error="")
        self._report(DrivePhase.AVAILABLE, None)

    def reset(self, _stop_id: int) -> bool:
        """Takes a reset a moment later; a report from before that comes first."""
        loop = asyncio.get_running_loop()
        loop.call_soon(self.report)
        if not self.hangs:
            loop.call_later(ON_ITS_WAY_S, self._take_reset)
        return True

    def _take_reset(self) -> None:
        if self.obstacle:
            self.report()
        else:
            self._report(DrivePhase.AVAILABLE, None)

    def report(self) -> None:
        """Reports that nothing has changed, as it does all the time."""
        assert self.view.actual
        self._report(self.view.phase, self.view.stop)

    def confirm(self, by: str, reason: str) -> None:
        self._taken += 1
        latch = StopLatch(next(self._numbers), by, reason, time.monotonic_ns())
        self._report(DrivePhase.STOPPED, latch)

    def _report(self, phase: DrivePhase, stop: StopLatch | None) -> None:
        report = actual(
            instance_id=self._instance_id,
            phase=phase,
            stop=stop,
            monotonic_ns=time.monotonic_ns(),
            counters=DriveCounters(stops=self._taken),
            reset_obstacle=self.obstacle,
        )
        self.view = replace(self.view, actual=report)
        self.changes.notify_all()


@pytest.fixture
def drive() -> Drive:
    return Drive()


def stops_of(drive: Drive) -> Stops:
    double: Any = drive
    return Stops(double, double)


async def test_each_request_gets_a_stop_of_its_own(drive: Drive) -> None:
    """Two people with one credential: the reset of the first one's stop must not undo the second one's."""
    stops = stops_of(drive)
    first = await stops.stop("anna", "", "one")
    second = await stops.stop("anna", "", "two")
    assert (first.stop_id, second.stop_id) == (1, 2)
    assert await stops.stop("anna", "", "one") == first, "a copy"
    with pytest.raises(PreconditionError, match="the present stop is 2"):
        await stops.reset(first.stop_id)


async def test_a_report_of_an_earlier_stop_confirms_no_later_one(drive: Drive) -> None:
    """Reports come all the time while the robot is stopped, also before a further stop has arrived."""
    stops = stops_of(drive)
    await stops.stop("anna", "", "one")
    stopping = asyncio.create_task(stops.stop("anna", "", "two"))
    asyncio.get_running_loop().call_soon(drive.report)
    assert (await stopping).stop_id == 2


async def test_stops_of_two_callers_in_turns_are_few_for_the_drive_program(drive: Drive) -> None:
    """Each caller's are confirmed once in a while, also when the other one stops in between."""
    stops = stops_of(drive)
    for number in range(200):
        for by in ("anna", "ben"):
            assert await stops.stop(by, "", f"request {number}")
    assert drive.sent[:2] == ["anna", "ben"]
    assert len(drive.sent) < 40


async def test_many_stops_of_one_caller_at_once_are_one(drive: Drive) -> None:
    stops = stops_of(drive)
    found = await asyncio.gather(*(stops.stop("anna", "") for _ in range(200)))
    assert {each.stop_id for each in found} == {1}
    assert drive.sent == ["anna"]


async def test_after_a_reset_a_stop_stops_anew(drive: Drive) -> None:
    stops = stops_of(drive)
    for by in ("anna", "ben"):
        stop = await stops.stop(by, "")
    await stops.reset(stop.stop_id)
    assert (await stops.stop("anna", "")).stop_id == 3


async def test_a_report_from_before_a_reset_is_no_answer_to_it(drive: Drive) -> None:
    """Reports come all the time, and so also while the reset is on its way."""
    stops = stops_of(drive)
    stop = await stops.stop("anna", "")
    assert await stops.reset(stop.stop_id) == "the stop is reset; the driver has to release and to hold again"


@in_virtual_time
async def test_an_obstacle_is_an_answer_at_once(drive: Drive) -> None:
    stops = stops_of(drive)
    stop = await stops.stop("anna", "")
    drive.obstacle = "the driver holds"
    with pytest.raises(PreconditionError, match="is not reset: the driver holds"):
        await stops.reset(stop.stop_id)
    assert asyncio.get_running_loop().time() < CONFIRMED_WITHIN_S


@in_virtual_time
async def test_an_obstacle_that_is_gone_when_the_reset_arrives_is_none(drive: Drive) -> None:
    stops = stops_of(drive)
    stop = await stops.stop("anna", "")
    drive.obstacle = "the driver holds"
    asyncio.get_running_loop().call_later(ON_ITS_WAY_S / 2, setattr, drive, "obstacle", "")
    assert "the stop is reset" in await stops.reset(stop.stop_id)


@in_virtual_time
async def test_a_reset_that_nothing_follows_is_refused_in_the_end(drive: Drive) -> None:
    stops = stops_of(drive)
    stop = await stops.stop("anna", "")
    drive.hangs = True
    with pytest.raises(PreconditionError, match="is not reset: try again"):
        await stops.reset(stop.stop_id)


async def test_a_stop_that_finds_the_connection_full_is_sent_again(drive: Drive) -> None:
    drive.full = 5
    assert (await stops_of(drive).stop("anna", "")).by == "anna"
    assert drive.sent == ["anna"]


@in_virtual_time
async def test_but_not_without_end(drive: Drive) -> None:
    drive.full = 10**6
    with pytest.raises(DriveUnreachableError):
        await stops_of(drive).stop("anna", "")


async def test_nor_where_the_drive_program_has_gone(drive: Drive) -> None:
    drive.go()
    with pytest.raises(DriveUnreachableError, match="can't be reached"):
        await stops_of(drive).stop("anna", "")
    assert drive.full == 10**6 - 1


async def test_a_stop_that_finds_no_drive_program_is_kept_until_the_next_has_it(drive: Drive) -> None:
    """Or autonomy would go on when it is back, although a person has stopped the robot."""
    stops = stops_of(drive)
    drive.confirm("ben", "")  # Of the process before, whose count begins anew.
    drive.go()
    with pytest.raises(DriveUnreachableError, match="first of all when it is connected again"):
        await stops.stop("anna", "")
    stops.follow()
    assert drive.kept == "anna"
    drive.come_back()
    stops.follow()
    assert drive.kept == "anna", "connected is not confirmed"
    drive.confirm("anna", "")
    stops.follow()
    assert not drive.kept


@in_virtual_time
async def test_a_stop_that_is_confirmed_too_late_is_kept_until_then(drive: Drive) -> None:
    stops = stops_of(drive)
    drive.hangs = True
    with pytest.raises(DriveUnreachableError, match="not confirmed the stop"):
        await stops.stop("anna", "")
    drive.report()
    stops.follow()
    assert drive.kept == "anna"
    drive.confirm("anna", "")
    stops.follow()
    assert not drive.kept, "or a later process would stop by it"


async def test_a_stop_that_is_confirmed_is_not_kept(drive: Drive) -> None:
    await stops_of(drive).stop("anna", "")
    assert not drive.kept
