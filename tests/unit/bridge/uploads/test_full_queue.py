"""More recordings are to be copied than the queue has places."""

import logging
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import pytest

from bridge.connection.uploading import QueuedUploads
from bridge.uploads import kept_queue
from bridge.uploads.queue import Priority, State, Upload
from common.errors import NotFoundError, TooMuchError
from console.client.results import Recording, RecordingCopyState, RecordingKind
from omniseer.gateway.v1 import cloud_pb2
from tests.support.uploading import Robot, Rows, Running, running_uploads

HUB: Any = None
PLACES = 5


@pytest.fixture(autouse=True)
def _few_places(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_queue, "MOST_WAITING", PLACES)


def robot_with(count: int) -> Robot:
    """A robot with so many ordinary recordings, none of them known to the recorder as one to be copied."""
    robot = Robot()
    for number in range(count):
        add(robot, f"rec-{number:02}", number + 1)
    return robot


def add(robot: Robot, name: str, started: int, kind: RecordingKind = RecordingKind.MANUAL) -> None:
    known = robot.add(name, {"data.bin": b"x"}, started_unix_ms=started)
    copy = replace(known.copy, state=RecordingCopyState.UNKNOWN)
    robot.recordings[name] = replace(known, kind=kind, copy=copy)


def expected(robot: Robot, name: str) -> None:
    """The recorder knows that a recording is to be copied."""
    known = robot.recordings[name]
    robot.recordings[name] = replace(known, copy=replace(known.copy, state=RecordingCopyState.QUEUED))


def closed(robot: Robot, rows: Rows | None = None, rule: str = "all") -> Any:
    """Uploads that nothing leaves."""
    return running_uploads(robot, HUB, "127.0.0.1:9", (), rows, only_while_charging=True, rule=rule)


async def listed(running: Running, robot: Robot) -> None:
    """The recorder's list is read, the newest first, in pages of two."""
    newest_first = sorted(robot.recordings.values(), key=lambda each: -each.started_unix_ms)
    running.uploads.queue.begin_listing()
    for page in pages(newest_first):
        await running.uploads.consider(page)
    running.uploads.queue.end_listing()


def pages(recordings: list[Recording]) -> Iterable[list[Recording]]:
    return (recordings[first : first + 2] for first in range(0, len(recordings), 2))


def waiting(running: Running) -> list[str]:
    return [each.recording_id for each in running.uploads.queue.waiting]


async def test_an_incident_takes_the_place_of_the_last_one() -> None:
    """The defect: it had none, was not protected on the robot, and went before those that had one."""
    robot, rows = robot_with(PLACES), Rows()
    async with closed(robot, rows) as running:
        await listed(running, robot)
        for name in waiting(running):
            expected(robot, name)
        add(robot, "incident", 99, RecordingKind.INCIDENT)
        await listed(running, robot)
        assert waiting(running) == ["incident", "rec-00", "rec-01", "rec-02", "rec-03"]
        assert rows.rows.keys() == set(waiting(running)), "also after a restart"
        assert running.uploads.queue.left_out.count == 1
        # The one without a place is the next to get one.
        await running.uploads.cancel("rec-01")
        await listed(running, robot)
        assert waiting(running) == ["incident", "rec-00", "rec-02", "rec-03", "rec-04"]
        assert running.uploads.queue.left_out.count == 0


async def test_the_places_are_of_the_oldest_on_whatever_page_they_are() -> None:
    """The defect: of the newest, and the robot deletes the oldest first."""
    robot, rows = robot_with(3 * PLACES), Rows()
    async with closed(robot, rows) as running:
        for _ in range(2):
            await listed(running, robot)
            assert waiting(running) == [f"rec-{number:02}" for number in range(PLACES)]
            assert running.uploads.queue.left_out.count == 2 * PLACES
        assert rows.rows.keys() == set(waiting(running))


async def test_what_has_no_place_is_reported_once(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "bridge.uploads.kept_queue")
    robot = robot_with(PLACES + 1)
    status = cloud_pb2.CloudStatus()
    async with closed(robot) as running:
        for _ in range(3):
            await listed(running, robot)
        QueuedUploads(running.uploads).describe(status)
        assert (status.uploads_waiting, status.uploads_left_out) == (PLACES, 1)
        robot.delete("rec-05")
        for _ in range(3):
            await listed(running, robot)
        assert running.uploads.queue.left_out.count == 0
    reports = [each.message for each in caplog.records if "place" in each.message]
    assert len(reports) == 2
    assert reports[0] == "1 recordings are to be copied and find no place: 5 wait already"


async def test_a_request_by_hand_goes_before_what_the_rule_has_queued_and_not_before_others_by_hand() -> None:
    robot = robot_with(PLACES)
    async with closed(robot) as running:
        await listed(running, robot)
        for number in range(PLACES):
            add(robot, f"hand-{number}", 50 - number)
            await running.uploads.enqueue(f"hand-{number}")
        by_hand = set(waiting(running))
        assert by_hand == {f"hand-{number}" for number in range(PLACES)}
        with pytest.raises(TooMuchError, match="5 recordings wait"):
            await running.uploads.enqueue("rec-00")
        assert set(waiting(running)) == by_hand


async def test_a_run_bundle_that_was_requested_by_hand_keeps_its_place() -> None:
    """The defect: it was lost. The recorder keeps no state of it, and so does not expect its copy."""
    robot, rows = Robot(), Rows()
    for number in range(PLACES - 1):
        add(robot, f"rec-{number}", number)
    add(robot, "run-2", 99, RecordingKind.RUN_BUNDLE)
    async with closed(robot, rows, "incidents") as running:
        for name in robot.recordings:
            await running.uploads.enqueue(name)
    async with closed(robot, rows, "incidents") as running:
        for number in range(PLACES):
            add(robot, f"incident-{number}", 50 + number, RecordingKind.INCIDENT)
        await listed(running, robot)
        assert waiting(running) == [*(f"incident-{number}" for number in range(PLACES - 1)), "run-2"]
        assert running.uploads.queue.left_out.count == PLACES - 1 + 1
        # A further request by hand has no place before it, and learns of that.
        add(robot, "rec-9", 1)
        with pytest.raises(TooMuchError, match="5 recordings wait"):
            await running.uploads.enqueue("rec-9")


async def test_a_run_bundle_that_the_rule_has_queued_loses_its_place_and_gets_another_one() -> None:
    robot = robot_with(PLACES - 1)
    add(robot, "run-2", 99, RecordingKind.RUN_BUNDLE)
    async with closed(robot) as running:
        await listed(running, robot)
        assert "run-2" in waiting(running)
        add(robot, "incident", 100, RecordingKind.INCIDENT)
        await listed(running, robot)
        assert "run-2" not in waiting(running)
        await running.uploads.cancel("rec-00")
        await listed(running, robot)
        assert "run-2" in waiting(running)


async def test_one_without_a_place_can_be_cancelled() -> None:
    robot, rows = robot_with(PLACES + 1), Rows()
    expected(robot, "rec-05")
    async with closed(robot, rows) as running:
        await listed(running, robot)
        assert (await running.uploads.cancel("rec-05")).state is State.QUEUED
        assert rows.rows["rec-05"].state is State.LOCAL
        await listed(running, robot)
        assert running.uploads.queue.left_out.count == 0
        with pytest.raises(NotFoundError):
            await running.uploads.cancel("rec-05")


async def test_a_verified_one_that_has_changed_waits_for_a_place() -> None:
    robot, rows = robot_with(PLACES), Rows()
    async with closed(robot, rows) as running:
        await listed(running, robot)
    add(robot, "grown", 99)
    known = robot.recordings["grown"]
    robot.recordings["grown"] = replace(known, copy=replace(known.copy, state=RecordingCopyState.VERIFIED))
    rows.rows["grown"] = Upload(
        recording_id="grown", started_unix_ms=99, state=State.VERIFIED, size=known.size - 1
    )
    async with closed(robot, rows) as running:
        for _ in range(2):
            await listed(running, robot)
            assert "grown" not in waiting(running)
            assert running.uploads.queue.left_out.count == 1
        await running.uploads.cancel("rec-00")
        await listed(running, robot)
        assert "grown" in waiting(running)
        assert running.uploads.queue.left_out.count == 0


async def test_what_was_asked_for_by_hand_is_so_again_after_it_had_no_place() -> None:
    robot = robot_with(1)
    async with closed(robot, rule="incidents") as running:
        await running.uploads.enqueue("rec-00")
        expected(robot, "rec-00")
        for number in range(PLACES):
            add(robot, f"incident-{number}", 50 + number, RecordingKind.INCIDENT)
        await listed(running, robot)
        assert "rec-00" not in waiting(running)
        await running.uploads.cancel("incident-3")
        await listed(running, robot)
        upload = running.upload("rec-00")
        assert upload
        assert upload.priority is Priority.BY_HAND
