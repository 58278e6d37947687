"""Calls of recordings: passed on to the recorder with their caller and ID; its refusals come back."""

import asyncio
from pathlib import Path
from typing import Any

import grpc
import pytest

from common.reasons import Reason
from gateway.access.role import Role
from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.gateway.v1.recording_pb2_grpc import RecordingServiceStub
from tests.support.guarded_gateway import Login, guarded_gateway, new_robot
from tests.support.recorder_double import RecorderDouble, serving_recorder
from tests.support.recording_gateway import RecordingRobot, reaches, recording_robot
from tests.support.refusals import refused
from tests.support.running_gateway import running_gateway

ID = "request-1"


async def test_a_recording_from_start_to_deletion(tmp_path: Path) -> None:
    async with recording_robot(tmp_path) as robot:
        began = await robot.stub.StartRecording(
            pb.StartRecordingRequest(request_id=ID, label="lap 1", notes="wet"),
            metadata=(("x-request-id", "from-the-caller"),),
        )
        recording = began.recording
        assert (recording.label, recording.notes) == ("lap 1", "wet")
        request, metadata = robot.recorder.requests[-1]
        assert request.request_id == ID
        assert (metadata["x-request-id"], metadata["x-caller"]) == ("from-the-caller", "127.0.0.1")
        await reaches(robot, pb.RECORDER_STATE_RECORDING)
        assert (await robot.operator.status()).recording.label == "lap 1"
        again = await robot.stub.StartRecording(pb.StartRecordingRequest(request_id=ID, label="other"))
        assert again.recording.id == recording.id
        robot.recorder.write(b"messages", final=True)
        stopped = await robot.stub.StopRecording(pb.StopRecordingRequest(request_id="2"))
        assert stopped.recording.stop_reason == pb.RECORDING_STOP_REASON_REQUESTED
        snapshot = await robot.stub.TriggerSnapshot(pb.TriggerSnapshotRequest(request_id="3", pre_s=10))
        assert snapshot.recording.trigger == "127.0.0.1"
        page = await robot.stub.ListRecordings(pb.ListRecordingsRequest(page_size=1))
        assert [each.id for each in page.recordings] == [snapshot.recording.id]
        rest = await robot.stub.ListRecordings(pb.ListRecordingsRequest(page_token=page.next_page_token))
        assert [each.id for each in rest.recordings] == [recording.id]
        found = await robot.stub.GetRecording(pb.GetRecordingRequest(recording_id=recording.id))
        assert {each.name for each in found.recording.files} == {"data/000000.mcap", "metadata.yaml"}
        pin = pb.PinRecordingRequest(request_id="4", recording_id=recording.id, pinned=True)
        assert (await robot.stub.PinRecording(pin)).recording.pinned
        forced = pb.DeleteRecordingRequest(request_id="5", recording_id=recording.id, force=True)
        await robot.stub.DeleteRecording(forced)
        assert recording.id not in robot.recorder.recordings


async def test_what_the_recorder_refuses_is_refused_with_its_reason(tmp_path: Path) -> None:
    async with recording_robot(tmp_path) as robot:
        stub, double = robot.stub, robot.recorder
        done = double.add({"a": b"1"}, pinned=True)
        bundle = double.add({"a": b"1"})
        bundle.kind = pb.RECORDING_KIND_RUN_BUNDLE
        double.copy_wanted.add(double.add({"a": b"1"}, id="wanted").id)
        precondition = grpc.StatusCode.FAILED_PRECONDITION

        def delete(recording_id: str, **more: Any) -> Any:
            request = pb.DeleteRecordingRequest(request_id="d", recording_id=recording_id, **more)
            return stub.DeleteRecording(request)

        def start(**more: Any) -> Any:
            return stub.StartRecording(pb.StartRecordingRequest(request_id="s", **more))

        assert await refused(start(preset="none")) == (
            grpc.StatusCode.INVALID_ARGUMENT,
            Reason.INVALID_REQUEST,
        )
        double.has_video = double.has_room = double.has_ring = False
        assert await refused(start(with_video=True)) == (precondition, Reason.NO_VIDEO)
        assert await refused(start()) == (grpc.StatusCode.RESOURCE_EXHAUSTED, Reason.DISK_FULL)
        snapshot = stub.TriggerSnapshot(pb.TriggerSnapshotRequest(request_id="t"))
        assert await refused(snapshot) == (precondition, Reason.NO_RING)
        assert await refused(delete(done.id)) == (precondition, Reason.RECORDING_PINNED)
        assert await refused(delete("wanted")) == (precondition, Reason.RECORDING_NOT_COPIED)
        assert await refused(delete(bundle.id, force=True)) == (precondition, Reason.RECORDING_READ_ONLY)
        changed = delete(done.id, force=True, expected_sha256=b"x" * 32)
        assert await refused(changed) == (precondition, Reason.RECORDING_CHANGED)
        missing = stub.GetRecording(pb.GetRecordingRequest(recording_id="no such"))
        assert await refused(missing) == (grpc.StatusCode.NOT_FOUND, Reason.RECORDING_NOT_FOUND)


async def test_a_robot_that_is_not_set_up_says_so(tmp_path: Path) -> None:
    async with running_gateway(tmp_path / "preview.sock") as operator:
        stub: Any = RecordingServiceStub(operator.channel)
        expected = (grpc.StatusCode.FAILED_PRECONDITION, Reason.RECORDING_NOT_CONFIGURED)
        assert await refused(stub.ListRecordings(pb.ListRecordingsRequest())) == expected
        request = pb.ExportRecordingRequest(recording_id="a", file="b")
        assert await refused(stub.ExportRecording(request).read()) == expected
        assert not (await operator.status()).HasField("recording")


async def test_a_recorder_that_is_gone_and_one_that_is_frozen(tmp_path: Path) -> None:
    socket = tmp_path / "recorder.sock"
    async with running_gateway(tmp_path / "preview.sock", recording={"socket": socket}) as operator:
        robot = RecordingRobot(operator, RecorderDouble())
        expected = (grpc.StatusCode.UNAVAILABLE, Reason.RECORDER_UNREACHABLE)
        assert await refused(robot.stub.ListRecordings(pb.ListRecordingsRequest(), timeout=10)) == expected
        assert await robot.state() == pb.RECORDER_STATE_UNREACHABLE
        async with serving_recorder(socket, robot.recorder):
            await reaches(robot, pb.RECORDER_STATE_IDLE)
            robot.recorder.thawed.clear()
            assert (
                await refused(robot.stub.ListRecordings(pb.ListRecordingsRequest(), timeout=10)) == expected
            )
            await reaches(robot, pb.RECORDER_STATE_UNREACHABLE)
            robot.recorder.thawed.set()
            await reaches(robot, pb.RECORDER_STATE_IDLE)
        await reaches(robot, pb.RECORDER_STATE_UNREACHABLE)


async def test_force_is_for_administrators(tmp_path: Path) -> None:
    access, double, socket = new_robot(tmp_path / "access"), RecorderDouble(), tmp_path / "recorder.sock"
    logins = {role: access.add(role)[1] for role in (Role.OPERATOR, Role.ADMIN)}
    recording = double.add({"a": b"1"}, pinned=True)
    request = pb.DeleteRecordingRequest(request_id=ID, recording_id=recording.id, force=True)
    async with (
        serving_recorder(socket, double),
        guarded_gateway(access, recording={"socket": socket}) as robot,
    ):

        def call(method: str, request: Any, login: Login) -> Any:
            stub: Any = RecordingServiceStub(robot.channel(login))
            return getattr(stub, method)(request, metadata=login.metadata(), timeout=5)

        denied = (grpc.StatusCode.PERMISSION_DENIED, Reason.ROLE_TOO_LOW)
        assert await refused(call("DeleteRecording", request, logins[Role.OPERATOR])) == denied
        assert recording.id in double.recordings
        await call("DeleteRecording", request, logins[Role.ADMIN])
        assert recording.id not in double.recordings
        assert double.requests[-1][1]["x-caller"] == "anna"
    done, denials = (path.read_text(encoding="utf-8") for path in (access.audit_file, access.refused_file))
    assert "DeleteRecording" in done
    assert "DeleteRecording" in denials


async def test_a_caller_that_leaves_ends_its_call_at_the_recorder(tmp_path: Path) -> None:
    async with recording_robot(tmp_path) as robot:
        robot.recorder.thawed.clear()
        call = robot.stub.ListRecordings(pb.ListRecordingsRequest())
        await asyncio.sleep(0)
        call.cancel()
        with pytest.raises(asyncio.CancelledError):
            await call
        robot.recorder.thawed.set()
        await robot.stub.ListRecordings(pb.ListRecordingsRequest(), timeout=5)
