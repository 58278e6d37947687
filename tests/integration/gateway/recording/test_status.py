"""What operators see of the recorder: status, events, faults, metrics, incidents."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from omniseer.gateway.v1 import event_pb2
from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.gateway.v1.robot_gateway_pb2 import (
    SubscribeEventsRequest,
    WatchSystemStatusRequest,
)
from tests.support.eventually import eventually
from tests.support.recording_gateway import RecordingRobot, reaches, recording_robot

ONE_SAMPLE = {"interval_ms": 60_000, "stale_after_ms": 120_000}
QUICK = {"startup_grace_ms": 0, "clear_after_ms": 0}


async def changes(robot: RecordingRobot, count: int) -> list[event_pb2.RecordingStateChanged]:
    """The first events of recordings."""
    found: list[event_pb2.RecordingStateChanged] = []
    stream: Any = robot.operator.stub.SubscribeEvents(SubscribeEventsRequest(), timeout=10)
    while len(found) < count:
        event = (await stream.read()).event
        if event.HasField("recording_state_changed"):
            found.append(event.recording_state_changed)
    stream.cancel()
    return found


async def test_a_recording_begins_loses_and_ends_in_events(tmp_path: Path) -> None:
    async with recording_robot(tmp_path) as robot:
        recording = await robot.start(label="lap")
        double = robot.recorder
        await reaches(robot, pb.RECORDER_STATE_RECORDING)
        double.report.status.messages_lost = 7
        double.changed()
        *_, lost = await changes(robot, 2)
        assert (lost.change, lost.messages_lost) == (event_pb2.RECORDING_CHANGE_LOSS, 7)
        double.end(pb.RECORDING_STOP_REASON_DISK)
        began, _, ended = await changes(robot, 3)
        assert (began.change, began.recording_id, began.label) == (
            event_pb2.RECORDING_CHANGE_STARTED,
            recording.id,
            "lap",
        )
        assert (ended.change, ended.recording_id, ended.stop_reason) == (
            event_pb2.RECORDING_CHANGE_ENDED,
            recording.id,
            pb.RECORDING_STOP_REASON_DISK,
        )


@pytest.mark.timed
async def test_a_recording_that_only_grows_wakes_no_watcher(tmp_path: Path) -> None:
    async with recording_robot(tmp_path, platform=ONE_SAMPLE) as robot:
        # The computer's load is a change, too: every sample of it wakes watchers.
        await eventually(
            robot.operator.status, lambda now: now.platform.network.available, "the platform's only sample"
        )
        await robot.start()
        await reaches(robot, pb.RECORDER_STATE_RECORDING)
        request = WatchSystemStatusRequest(min_interval_ms=50)
        stream: Any = robot.operator.stub.WatchSystemStatus(request, timeout=20)
        status = robot.recorder.report.status
        received: list[Any] = []
        while len(received) < 4:
            status.elapsed_ms += 500
            status.size += 1000
            status.messages_written += 10
            robot.recorder.changed()
            received.append(await stream.read())
        stream.cancel()
        gaps = [later.monotonic_ns - earlier.monotonic_ns for earlier, later in pairwise(received[1:])]
        assert min(gaps) >= 0.9e9, "a heartbeat comes once a second, and nothing between"
        assert received[-1].status.recording.elapsed_ms > received[0].status.recording.elapsed_ms


async def test_faults_of_the_disk_make_no_incident_and_others_do(tmp_path: Path) -> None:
    async with recording_robot(tmp_path, faults=QUICK) as robot:
        double = robot.recorder

        async def faults() -> dict[str, bool]:
            return {each.id: each.active for each in (await robot.operator.status()).faults}

        double.report.disk_short = True
        double.report.messages_dropped = 3
        double.changed()
        await eventually(faults, lambda now: now.get("recording.disk"), "the disk is a fault")
        assert (await faults())["recording.losing"]
        double.report.status.state = pb.RECORDER_STATE_FAULTED
        double.report.status.last_error = "the disk takes no data"
        double.changed()
        await reaches(robot, pb.RECORDER_STATE_FAULTED)
        await robot.operator.switch(True, timeout_s=10)  # without a preview service: preview.unreachable

        async def reported() -> set[str]:
            return {each.fault_id for each in double.faults}

        found = await eventually(reported, lambda now: "preview.unreachable" in now, "the fault is reported")
        assert not [each for each in found if each.startswith("recording.")]
        double.report.status.state, double.report.disk_short = pb.RECORDER_STATE_IDLE, False
        double.changed()
        await eventually(faults, lambda now: now["recording.disk"] is False, "it is cleared")
