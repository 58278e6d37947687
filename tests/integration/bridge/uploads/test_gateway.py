"""Uploads through a real gateway, by the ordinary client."""

import pytest

from bridge.uploads.queue import State
from common.errors import NotFoundError
from console.client import AsyncGatewayClient
from omniseer.gateway.v1 import recording_pb2 as pb
from tests.support.recorder_double import RecorderDouble
from tests.support.recording_gateway import recording_robot
from tests.support.upload_ground import Ground
from tests.support.uploading import FLEET, MIB, ROBOT, content, running_receiver, running_uploads

FILES = {"data/000000.mcap": content(9 * MIB + 5), "metadata.yaml": b"version: 9\n", "empty": b""}


@pytest.mark.parametrize("kind", [pb.RECORDING_KIND_MANUAL, pb.RECORDING_KIND_RUN_BUNDLE])
async def test_what_the_gateway_exports_is_what_the_store_has(
    ground: Ground, tmp_path_factory: pytest.TempPathFactory, kind: pb.RecordingKind.ValueType
) -> None:
    double = RecorderDouble()
    double.add(FILES, id="one")
    double.recordings["one"].kind = kind
    async with (
        recording_robot(tmp_path_factory.mktemp("g"), double) as robot,
        AsyncGatewayClient(f"127.0.0.1:{robot.port}") as client,
        running_receiver(ground.receivers[0]),
        running_uploads(client, ground.hub, ground.proxy.host, ground.keys) as running,
    ):
        with pytest.raises(NotFoundError):
            await running.uploads.enqueue("none")
        double.wrong_crcs = 1
        await running.uploads.enqueue("one")
        await running.until("one", lambda each: each is not None and each.state is State.VERIFIED)
        assert running.uploads.cuts == 1, "a damaged chunk is a cut"
    for name, data in FILES.items():
        found = ground.server.client.get_object(Bucket=ground.store.bucket, Key=f"{FLEET}/{ROBOT}/one/{name}")
        assert found["Body"].read() == data
