"""Operators' calls about copies: passed on to the bridge, refused with reasons, known to the recorder."""

import asyncio
import json
from pathlib import Path
from typing import Any

import grpc
import pytest

from common.reasons import Reason
from console.client import AsyncGatewayClient, CloudState, GatewayClient, RecordingCopyState
from gateway.access.role import Role
from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.gateway.v1.recording_pb2_grpc import RecordingServiceStub
from tests.support.bridge_double import FULL, NOT_THERE, RUNS, BridgeDouble, serving_bridge
from tests.support.eventually import eventually
from tests.support.fleet_robot import FleetRobot, fleet_robot
from tests.support.guarded_gateway import guarded_gateway, new_robot
from tests.support.recorder_double import RecorderDouble, serving_recorder
from tests.support.recording_gateway import recording_robot
from tests.support.refusals import refused
from tests.support.robotctl import only_line, robotctl, robotctl_process

QUEUED, UPLOADING = pb.RECORDING_COPY_STATE_QUEUED, pb.RECORDING_COPY_STATE_UPLOADING
VERIFIED, NONE = pb.RECORDING_COPY_STATE_VERIFIED, pb.RECORDING_COPY_STATE_UNSPECIFIED


def upload(request_id: str = "1", recording_id: str = "one") -> pb.UploadRecordingRequest:
    return pb.UploadRecordingRequest(request_id=request_id, recording_id=recording_id)


def cancel(request_id: str = "2", recording_id: str = "one") -> pb.CancelUploadRequest:
    return pb.CancelUploadRequest(request_id=request_id, recording_id=recording_id)


async def recorder_has(robot: FleetRobot, state: Any, recording_id: str = "one") -> None:
    async def now() -> Any:
        return robot.recorder.recordings[recording_id].copy.state

    await eventually(now, lambda found: found == state, f"the recorder knows of state {state}")


async def test_a_recording_is_queued_copied_and_verified_and_the_recorder_knows(tmp_path: Path) -> None:
    async with fleet_robot(tmp_path) as robot:
        robot.recorder.add({"a": b"1"}, id="one")
        answer = await robot.stub.UploadRecording(upload(), metadata=(("x-request-id", "from-a-caller"),))
        assert (answer.copy.state, answer.message) == (QUEUED, "one waits to be copied to the fleet's store")
        ((method, recording_id, metadata),) = robot.bridge.calls
        assert (method, recording_id, metadata["x-caller"]) == ("upload", "one", "127.0.0.1")
        assert metadata["x-request-id"] == "from-a-caller"
        await recorder_has(robot, QUEUED)
        copy = robot.bridge.copies("one")
        copy.state, copy.bytes_done = UPLOADING, 1
        robot.bridge.changed()
        await recorder_has(robot, UPLOADING)
        copy.state = VERIFIED
        robot.bridge.changed()
        await recorder_has(robot, VERIFIED)
        assert (await robot.stub.UploadRecording(upload("3"))).copy.state == VERIFIED
        kept = await robot.stub.CancelUpload(cancel("4"))
        assert kept.message == "one is in the fleet's store already, verified"
        event = await robot.event("recording_copy_changed")
        assert event.recording_copy_changed.copy.state == VERIFIED


async def test_a_repeated_request_changes_nothing(tmp_path: Path) -> None:
    async with fleet_robot(tmp_path) as robot:
        robot.recorder.add({"a": b"1"}, id="one")
        await robot.stub.UploadRecording(upload())
        await robot.stub.CancelUpload(cancel())
        await recorder_has(robot, NONE)
        again = await robot.stub.UploadRecording(upload())
        assert again.copy.state == QUEUED
        await robot.stub.CancelUpload(cancel())
        assert [method for method, _, _ in robot.bridge.calls] == ["upload", "cancel"]


async def test_a_repeated_request_of_another_recording_is_answered_of_the_first(tmp_path: Path) -> None:
    async with fleet_robot(tmp_path) as robot:
        robot.recorder.add({"a": b"1"}, id="one")
        robot.recorder.add({"a": b"2"}, id="two")
        first = await robot.stub.UploadRecording(upload())
        assert await robot.stub.UploadRecording(upload(recording_id="two")) == first
        ended = await robot.stub.CancelUpload(cancel())
        assert await robot.stub.CancelUpload(cancel(recording_id="two")) == ended
        assert [recording_id for _, recording_id, _ in robot.bridge.calls] == ["one", "one"]


async def test_what_the_bridge_refuses_is_refused_with_its_reason(tmp_path: Path) -> None:
    async with fleet_robot(tmp_path) as robot:
        stub, double = robot.stub, robot.bridge
        code = grpc.StatusCode
        for refusal, expected in (
            (NOT_THERE, (code.NOT_FOUND, Reason.RECORDING_NOT_FOUND)),
            (RUNS, (code.FAILED_PRECONDITION, Reason.RECORDING_RUNS)),
            (FULL, (code.RESOURCE_EXHAUSTED, Reason.TOO_MANY_UPLOADS)),
            (RuntimeError("a defect"), (code.INTERNAL, Reason.INTERNAL)),
        ):
            double.refusal = refusal
            assert await refused(stub.UploadRecording(upload())) == expected
        double.refusal = None
        assert await refused(stub.CancelUpload(cancel())) == (code.NOT_FOUND, Reason.UPLOAD_NOT_QUEUED)
        invalid = (code.INVALID_ARGUMENT, Reason.INVALID_REQUEST)
        assert await refused(stub.UploadRecording(upload(recording_id="x" * 65))) == invalid
        assert await refused(stub.UploadRecording(upload(request_id=""))) == invalid


async def test_a_robot_without_a_fleet_and_one_whose_bridge_is_away_say_so(tmp_path: Path) -> None:
    async with recording_robot(tmp_path) as robot:
        expected = (grpc.StatusCode.FAILED_PRECONDITION, Reason.FLEET_NOT_CONFIGURED)
        assert await refused(robot.stub.UploadRecording(upload())) == expected
    socket = tmp_path / "nothing.sock"
    async with recording_robot(tmp_path, bridge={"socket": socket}) as robot:
        expected = (grpc.StatusCode.UNAVAILABLE, Reason.BRIDGE_UNREACHABLE)
        assert await refused(robot.stub.UploadRecording(upload())) == expected
        assert await refused(robot.stub.CancelUpload(cancel())) == expected


async def test_copies_are_for_operators_and_in_the_audit_log(tmp_path: Path) -> None:
    access, recorder, bridge = new_robot(tmp_path / "access"), RecorderDouble(), BridgeDouble()
    logins = {role: access.add(role)[1] for role in (Role.VIEWER, Role.OPERATOR)}
    sockets = {name: tmp_path / f"{name}.sock" for name in ("recorder", "bridge")}
    async with (
        serving_recorder(sockets["recorder"], recorder),
        serving_bridge(sockets["bridge"], bridge),
        guarded_gateway(
            access, recording={"socket": sockets["recorder"]}, bridge={"socket": sockets["bridge"]}
        ) as robot,
    ):

        def call(role: Role) -> Any:
            stub: Any = RecordingServiceStub(robot.channel(logins[role]))
            return stub.UploadRecording(upload(), metadata=logins[role].metadata(), timeout=5)

        denied = (grpc.StatusCode.PERMISSION_DENIED, Reason.ROLE_TOO_LOW)
        assert await refused(call(Role.VIEWER)) == denied

        async def reached() -> bool:
            try:
                return bool((await call(Role.OPERATOR)).message)
            except grpc.aio.AioRpcError:
                return False

        await eventually(reached, bool, "the bridge is connected")
    done, denials = (path.read_text(encoding="utf-8") for path in (access.audit_file, access.refused_file))
    assert "UploadRecording" in done
    assert "UploadRecording" in denials


async def test_all_is_sent_again_to_a_recorder_that_was_away(tmp_path: Path) -> None:
    async with fleet_robot(tmp_path) as robot:
        robot.recorder.add({"a": b"1"}, id="one")
        robot.recorder.thawed.clear()
        robot.bridge.copies("one").state = QUEUED
        robot.bridge.changed()
        assert (await robot.stub.UploadRecording(upload())).copy.state == QUEUED, "the bridge is not held up"
        robot.recorder.thawed.set()
        await recorder_has(robot, QUEUED)
        robot.recorder.set_copies.clear()
        robot.recorder.report.instance_id = "another process"
        robot.recorder.changed()

        async def given() -> int:
            return len(robot.recorder.set_copies)

        await eventually(given, bool, "it is sent again")


async def typed(robot: FleetRobot, *words: str) -> Any:
    return await asyncio.to_thread(robotctl, "--target", f"127.0.0.1:{robot.port}", *words)


async def test_what_a_user_types_and_reads(tmp_path: Path) -> None:
    async with fleet_robot(tmp_path) as robot:
        robot.recorder.add({"a": bytes(1000)}, id="one")
        double = robot.bridge
        ran = await typed(robot, "record", "upload", "one")
        assert (ran.returncode, ran.stdout) == (0, "one waits to be copied to the fleet's store\n")
        wait = ("--target", f"127.0.0.1:{robot.port}", "record", "upload", "one", "--wait", "--json")
        waiting = asyncio.create_task(asyncio.to_thread(robotctl_process, *wait))
        copy = double.copies("one")
        copy.state, copy.bytes_done = UPLOADING, 340
        status = double.report.status
        status.uploads_waiting, status.uploading_id, status.uploading_size = 1, "one", 1000
        status.uploading.CopyFrom(copy)
        double.changed()
        await recorder_has(robot, UPLOADING)
        listed = await typed(robot, "record", "list")
        assert "uploading 34 %" in listed.stdout
        line = "CONNECTED  lab-1, fleet lab, 1 recording to copy, one uploading 34 %"
        await eventually(
            lambda: typed(robot, "status"), lambda shown: line in shown.stdout, "the status has it, too"
        )
        assert not waiting.done()
        status.uploading_id = ""
        status.ClearField("uploading")
        copy.state = VERIFIED
        double.changed()
        done = await asyncio.wait_for(waiting, 20)
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["copy"]["state"] == "verified"
        assert "verified" in (await typed(robot, "record", "show", "one")).stdout
        missing = await typed(robot, "record", "cancel-upload", "two")
        assert missing.returncode == 1
        assert "robotctl" in only_line(missing.stderr)


async def test_waiting_ends_when_the_copy_is_cancelled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("console.client.uploading._UNSEEN", 3)  # Statuses, of which there is one a second.
    async with fleet_robot(tmp_path) as robot:
        robot.recorder.add({"a": b"1"}, id="one")
        async with AsyncGatewayClient(f"127.0.0.1:{robot.port}") as client:
            assert (await client.upload_recording("one")).copy.state is RecordingCopyState.QUEUED
            await recorder_has(robot, QUEUED)
            seen = []
            async for progress in client.upload_progress("one"):
                seen.append(progress.copy.state)
                if len(seen) == 1:
                    await client.cancel_upload("one")
            assert seen[0] is RecordingCopyState.QUEUED
            assert seen[-1] is RecordingCopyState.UNKNOWN


async def test_the_blocking_library(tmp_path: Path) -> None:
    def use(port: int) -> list[Any]:
        with GatewayClient(f"127.0.0.1:{port}") as robot:
            answer, cloud = robot.upload_recording("one"), robot.status().cloud
            assert cloud
            return [answer.copy.state, cloud.state, robot.cancel_upload("one").message]

    async with fleet_robot(tmp_path) as robot:
        robot.recorder.add({"a": b"1"}, id="one")
        assert await asyncio.to_thread(use, robot.port) == [
            RecordingCopyState.QUEUED,
            CloudState.CONNECTED,
            "one is not copied to the fleet's store any more",
        ]
