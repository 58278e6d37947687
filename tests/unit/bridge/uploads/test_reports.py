"""The recorder gets the state of every copy, however many there are, by reports of 64."""

import asyncio
from dataclasses import replace
from typing import Any

import pytest

from bridge.connection.uploading import MOST_COPIES, QueuedUploads, apply_rule
from bridge.uploads.queue import State, Upload
from console.client import results
from console.client.errors import Unreachable
from gateway.links.bridge.copies import Copies
from gateway.links.bridge.wire import report_from
from gateway.status.cloud import CopyReport
from omniseer.bridge.v1 import bridge_service_pb2 as bridge_pb
from omniseer.gateway.v1 import cloud_pb2
from tests.support.cloud_views import NEVER
from tests.support.recorder_views import idle
from tests.support.recorder_views import view as recorder_view
from tests.support.uploading import Robot, Rows, running_uploads

BACKLOG = 300
NAMES = [f"rec-{number:03}" for number in range(BACKLOG)]


class Recorder:
    """Keeps the copy of each recording, and lists them a page at a time, as the gateway passes them on."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.writes = 0

    async def set_copy(self, report: CopyReport) -> None:
        self.writes += 1
        known = self.robot.recordings[report.recording_id]
        name = report.copy.state.name
        state = results.RecordingCopyState["UNKNOWN" if name == "UNSPECIFIED" else name]
        copy = replace(known.copy, state=state, reason=report.copy.reason, bytes_done=report.copy.bytes_done)
        self.robot.recordings[report.recording_id] = replace(known, copy=copy)

    async def list_recordings(self, page_size: int, page_token: str) -> results.RecordingPage:
        first = int(page_token or 0)
        found = list(self.robot.recordings.values())
        rest = first + page_size < len(found)
        status: Any = None
        return results.RecordingPage(
            recordings=tuple(found[first : first + page_size]),
            next_page_token=str(first + page_size) if rest else "",
            status=status,
        )

    def states(self) -> set[results.RecordingCopyState]:
        return {each.copy.state for each in self.robot.recordings.values()}


class Gateway:
    """Takes the bridge's reports as the gateway does."""

    def __init__(self, recorder: Any, uploads: QueuedUploads) -> None:
        self.copies = Copies(recorder)
        self.uploads = uploads
        self.now_s = 1000.0

    async def take(self) -> None:
        message = bridge_pb.WatchStateResponse(
            instance_id="a",
            status=cloud_pb2.CloudStatus(state=cloud_pb2.CLOUD_STATE_CONNECTED),
            copies=self.uploads.copies(),
        )
        assert len(message.copies) <= MOST_COPIES
        self.now_s += 1.0
        self.copies.take(
            NEVER.reported(report_from(message, self.now_s), self.now_s), recorder_view(idle(), self.now_s)
        )
        for _ in range(4 * MOST_COPIES):
            await asyncio.sleep(0)


def recorded_as(robot: Robot, name: str, state: results.RecordingCopyState) -> None:
    """The recorder has the copy of a recording in this state."""
    known = robot.recordings[name]
    robot.recordings[name] = replace(known, copy=replace(known.copy, state=state))


def rows_of(state: State) -> Rows:
    rows = Rows()
    rows.rows = {name: Upload(recording_id=name, size=1, state=state) for name in NAMES}
    return rows


async def listed(running: Any, recorder: Any) -> None:
    """The bridge reads the recorder's list once."""
    task = asyncio.create_task(apply_rule(running.uploads, recorder))
    for _ in range(40):
        await asyncio.sleep(0)
    task.cancel()


@pytest.mark.parametrize("state", [State.QUEUED, State.VERIFIED, State.LOCAL, State.FAILED])
async def test_a_backlog_of_300_reaches_the_recorder(state: State) -> None:
    robot = Robot()
    for name in NAMES:
        robot.add(name, {"data.bin": b"x"})
    recorder = Recorder(robot)
    before = results.RecordingCopyState.UPLOADING
    for name in NAMES:
        recorded_as(robot, name, before)
    hub: Any = None
    async with running_uploads(
        robot, hub, "127.0.0.1:9", (), rows_of(state), only_while_charging=True
    ) as running:
        gateway = Gateway(recorder, QueuedUploads(running.uploads))
        sending = asyncio.create_task(gateway.copies.run())
        await listed(running, recorder)
        for _ in range(2 * BACKLOG // MOST_COPIES):
            await gateway.take()
        assert before not in recorder.states()
        # What has arrived is not written again and again.
        await listed(running, recorder)
        assert len(running.uploads.queue.unconfirmed) == 0
        writes = recorder.writes
        for _ in range(2 * BACKLOG // MOST_COPIES):
            await gateway.take()
        assert recorder.writes == writes
        sending.cancel()


async def test_what_becomes_verified_in_a_backlog_is_reported_at_once() -> None:
    robot = Robot()
    hub: Any = None
    async with running_uploads(
        robot, hub, "127.0.0.1:9", (), rows_of(State.QUEUED), only_while_charging=True
    ) as running:
        uploads = QueuedUploads(running.uploads)
        await running.uploads.cancel(NAMES[200])
        copies = {each.recording_id: each for each in uploads.copies()}
        assert copies[NAMES[200]].HasField("state_age_ms")


async def test_a_copy_that_the_start_has_found_is_of_no_age() -> None:
    robot = Robot()
    hub: Any = None
    async with running_uploads(
        robot, hub, "127.0.0.1:9", (), rows_of(State.VERIFIED), only_while_charging=True
    ) as running:
        copies = QueuedUploads(running.uploads).copies()
        assert len(copies) == MOST_COPIES
        assert not any(each.HasField("state_age_ms") for each in copies)


async def test_a_recording_that_the_list_lacks_is_not_reported_for_ever() -> None:
    robot = Robot()
    recorder: Any = Recorder(robot)
    hub: Any = None
    async with running_uploads(
        robot, hub, "127.0.0.1:9", (), rows_of(State.QUEUED), only_while_charging=True
    ) as running:
        assert len(running.uploads.queue.unconfirmed) == BACKLOG
        await listed(running, recorder)
        assert len(running.uploads.queue.unconfirmed) == 0


async def test_a_list_that_breaks_off_confirms_nothing_that_it_does_not_show() -> None:
    robot = Robot()
    recorder: Any = Recorder(robot)
    hub: Any = None

    async def fails(_size: int, _token: str) -> results.RecordingPage:
        raise Unreachable("no gateway")

    recorder.list_recordings = fails
    async with running_uploads(
        robot, hub, "127.0.0.1:9", (), rows_of(State.QUEUED), only_while_charging=True
    ) as running:
        await listed(running, recorder)
        assert len(running.uploads.queue.unconfirmed) == BACKLOG
