"""The bridge as a real program, killed with SIGKILL amid a part: the next one goes on by itself.

What it goes on with is its outbox, and what the store has: there is no other request.
"""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import grpc
import pytest

from omniseer.bridge.v1 import bridge_service_pb2 as bridge_pb
from omniseer.bridge.v1.bridge_service_pb2_grpc import BridgeServiceStub
from omniseer.gateway.v1 import recording_pb2 as pb
from tests.support.eventually import eventually
from tests.support.recorder_double import RecorderDouble
from tests.support.recording_gateway import recording_robot
from tests.support.running_bridge import BridgeProgram, bridge_program
from tests.support.secure_hub import SecureHub
from tests.support.upload_ground import Ground
from tests.support.uploading import FLEET, MIB, ROBOT, content, running_receiver

PART = 8 * MIB
SIZE = 2 * PART + 3 * MIB + 1
"""Three parts, the last one short."""
RECORDING, FILE = "one", "data.bin"
WITHIN_S = 60.0


@asynccontextmanager
async def uploading_bridge(
    ground: Ground, secure: SecureHub, recorder: RecorderDouble, directory: Path
) -> AsyncIterator[BridgeProgram]:
    """A bridge that serves, between a gateway and what it uploads to."""
    files = secure.path / ROBOT
    settings = {
        "hub": {
            "servers": list(secure.servers.urls),
            "credentials": str(files / "bridge.creds"),
            "ca": str(secure.directory.ca_file),
            "receipts": str(files / "receipts.pub"),
            "robot": ROBOT,
            "fleet": FLEET,
        },
        "uploads": {"store_hosts": [ground.proxy.host], "insecure_store": True},
    }
    async with running_receiver(ground.receivers[0]), recording_robot(directory, recorder) as robot:
        with bridge_program(directory / "bridge", robot.port, secure.servers.urls, **settings) as bridge:
            await asyncio.to_thread(bridge.start)
            yield bridge


async def refusal(bridge: BridgeProgram) -> str:
    """Requests the upload; returns why it is refused, empty if it is not."""
    async with grpc.aio.insecure_channel(f"unix:{bridge.socket}") as channel:
        request = bridge_pb.UploadRecordingRequest(recording_id=RECORDING)
        try:
            await BridgeServiceStub(channel).UploadRecording(request, timeout=WITHIN_S)
        except grpc.aio.AioRpcError as error:
            return str(error.details())
    return ""


async def copy_state(bridge: BridgeProgram) -> str:
    """Returns how far the copy is, as the gateway is to know it; empty where none is known."""
    state = await asyncio.to_thread(lambda: bridge.state)
    found = (each.copy.state for each in state.copies if each.recording_id == RECORDING)
    return next((pb.RecordingCopyState.Name(each) for each in found), "")


@pytest.mark.parametrize(
    "arrived", [pytest.param(3 * MIB, id="within-the-part"), pytest.param(PART, id="before-the-answer")]
)
async def test_killed_amid_a_part_it_goes_on_by_itself_and_sends_at_most_that_part_again(
    ground: Ground, secure: SecureHub, tmp_path: Path, arrived: int
) -> None:
    data, recorder, proxy = content(SIZE), RecorderDouble(), ground.proxy
    recorder.add({FILE: data}, id=RECORDING)
    proxy.hold_at = 2, arrived
    async with uploading_bridge(ground, secure, recorder, tmp_path) as bridge:
        await eventually(lambda: refusal(bridge), lambda why: not why, "the upload is queued", WITHIN_S)
        async with asyncio.timeout(WITHIN_S):
            await proxy.held.wait()
        bridge.kill()
        assert set(proxy.passed) == {1}, "the store has the first part alone"
        first, attempts = proxy.received[1], len(recorder.exports)
        await asyncio.to_thread(bridge.start)
        await eventually(
            lambda: copy_state(bridge),
            lambda now: now == "RECORDING_COPY_STATE_VERIFIED",
            "the next bridge has it verified",
            WITHIN_S,
        )
    assert proxy.received[1] == first, "what the store had is not sent again"
    assert all(offset >= PART for _, offset in recorder.exports[attempts:]), "nor is it read again"
    # Of two attempts, unless the machine has stood still for long enough to cut one.
    assert proxy.total - SIZE <= (len(recorder.exports) - 1) * PART
    key = f"{FLEET}/{ROBOT}/{RECORDING}/{FILE}"
    found = ground.server.client.get_object(Bucket=ground.store.bucket, Key=key)
    assert found["Body"].read() == data
