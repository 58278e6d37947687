"""Gateway and recorder are the real programs, and what the hub requests ends on the recorder's disk."""

import asyncio
import json
from pathlib import Path
from typing import Any

import grpc
import pytest

from common.reasons import Reason
from omniseer.bridge.v1 import bridge_service_pb2 as bridge_pb
from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.gateway.v1.recording_pb2_grpc import RecordingServiceStub
from tests.support.bridge_double import BridgeDouble, serving_bridge
from tests.support.eventually import eventually
from tests.support.gateway_program import gateway_program
from tests.support.refusals import refused
from tests.support.running_recorder import RecorderProgram, recorder_program

pytestmark = pytest.mark.ros


async def manifest_has(recorder: RecorderProgram, recording_id: str, state: str) -> None:
    """Waits until the manifest on the disk has a state of the copy."""

    async def now() -> str:
        text = (recorder.root / "recordings" / recording_id / "manifest.json").read_text(encoding="utf-8")
        return str(json.loads(text).get("copied", {}).get("state"))

    await eventually(now, lambda found: found == state, f"the copy is {state} on the disk")


@pytest.mark.usefixtures("ros_domain")
async def test_a_snapshot_and_its_copy_reach_the_disk_over_a_restart(tmp_path: Path) -> None:
    bridge, socket = BridgeDouble(), tmp_path / "bridge.sock"
    audit = tmp_path / "audit.jsonl"
    settings: dict[str, Any] = {
        "sources": [],
        "recording": {"socket": str(tmp_path / "recorder.sock")},
        "bridge": {"socket": str(socket), "allowed_requests": ["upload", "snapshot"]},
        "security": {"audit": {"file": str(audit)}},
    }

    async def answer(request_id: str) -> Any:
        async def now() -> Any:
            return next((each for each in bridge.answers if each.request_id == request_id), None)

        return await eventually(now, bool, f"the answer to {request_id}")

    with (
        recorder_program(tmp_path, ring={"preset": "all"}) as recorder,
        gateway_program(tmp_path, **settings) as gateway,
    ):
        async with (
            serving_bridge(socket, bridge),
            grpc.aio.insecure_channel(f"127.0.0.1:{gateway.port}") as channel,
        ):
            bridge.request("snap", snapshot={"pre_s": 1, "post_s": 0, "label": "from the hub"})
            made = await answer("snap")
            assert made.outcome == bridge_pb.REQUEST_OUTCOME_DONE, made.message
            recording_id = made.recording_id

            async def found() -> pb.Recording:
                return await asyncio.to_thread(recorder.recording, recording_id)

            complete = await eventually(found, lambda each: each.ended_unix_ms, "the snapshot is complete")
            assert (complete.label, complete.trigger) == ("from the hub", "fleet: anna")
            bridge.request("copy", upload={"recording_id": recording_id})
            assert (await answer("copy")).recording_id == recording_id
            await manifest_has(recorder, recording_id, "queued")
            stub: Any = RecordingServiceStub(channel)
            request = pb.DeleteRecordingRequest(request_id="d", recording_id=recording_id)
            assert await refused(stub.DeleteRecording(request)) == (
                grpc.StatusCode.FAILED_PRECONDITION,
                Reason.RECORDING_NOT_COPIED,
            )
            recorder.kill()
            bridge.copies(recording_id).state = pb.RECORDING_COPY_STATE_VERIFIED
            bridge.changed()
            await asyncio.to_thread(recorder.start)
            await manifest_has(recorder, recording_id, "verified")
            await stub.DeleteRecording(request)
    who = [json.loads(line)["who"] for line in audit.read_text(encoding="utf-8").splitlines()]
    assert who.count("fleet: anna") == 2
