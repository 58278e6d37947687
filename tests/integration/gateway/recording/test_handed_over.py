"""A real recorder hands the files of exports to a real gateway, which closes them when it should."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import grpc
import pytest

from common.reasons import Reason
from gateway.rpc.responses import export_stream
from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.gateway.v1.recording_pb2_grpc import RecordingServiceStub
from tests.support.descriptors import descriptors_of
from tests.support.eventually import eventually
from tests.support.refusals import refused
from tests.support.running_gateway import running_gateway
from tests.support.served_recorder import Served, exported, served

MIB = 1024 * 1024
SIZE = 60 * MIB
"""More than any buffer between the recorder's disk and a caller that does not read."""


@dataclass
class Robot:
    """A gateway and a recorder with one recording."""

    stub: Any
    recorder: Served
    recording: pb.Recording

    @property
    def request(self) -> pb.ExportRecordingRequest:
        return pb.ExportRecordingRequest(recording_id=self.recording.id, file=self.recording.files[0].name)

    @property
    def path(self) -> Path:
        root = self.recorder.running.settings.root
        return root / "recordings" / self.recording.id / self.recording.files[0].name

    async def descriptors(self) -> int:
        """Of the file, in this process, which both run in."""
        return len(descriptors_of(self.path))


@asynccontextmanager
async def robot(folder: Path, size: int = SIZE) -> AsyncIterator[Robot]:
    async with (
        served(folder) as recorder,
        running_gateway(folder / "preview.sock", recording={"socket": folder / "recorder.sock"}) as operator,
    ):
        stub: Any = RecordingServiceStub(operator.channel)
        made = Robot(stub, recorder, await recorder.recorded(size, 60))

        async def answers() -> bool:
            try:
                return bool(await stub.GetRecording(pb.GetRecordingRequest(recording_id=made.recording.id)))
            except grpc.aio.AioRpcError:
                return False

        await eventually(answers, bool, "the gateway has reached the recorder")
        yield made


async def to_its_end(stream: Any) -> None:
    while await stream.read() is not grpc.aio.EOF:
        pass


async def test_what_the_gateway_reads_is_the_file(tmp_path: Path) -> None:
    async with robot(tmp_path, 3 * MIB) as made:
        file = made.recording.files[0]
        for offset in (0, file.size - 5, file.size):
            header, content = await exported(
                made.stub, recording_id=made.recording.id, file=file.name, offset=offset
            )
            assert header.sha256 == file.sha256
            assert content == made.path.read_bytes()[offset:]
        await eventually(made.descriptors, lambda count: count == 0, "the file is closed")


@pytest.mark.timed
async def test_a_stalled_export_closes_its_file_and_says_so_when_it_is_read_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(export_stream, "STALLED_S", 1.0)
    async with robot(tmp_path) as made:
        stream = made.stub.ExportRecording(made.request)
        await stream.read()
        await stream.read()
        assert await made.descriptors() >= 2
        await eventually(made.descriptors, lambda count: count == 0, "the file is closed")
        assert await refused(to_its_end(stream)) == (
            grpc.StatusCode.RESOURCE_EXHAUSTED,
            Reason.EXPORT_STALLED,
        )


async def test_a_deletion_frees_the_disk_though_a_caller_takes_nothing(tmp_path: Path) -> None:
    async with robot(tmp_path) as made:
        stream = made.stub.ExportRecording(made.request)
        await stream.read()
        await stream.read()
        delete = pb.DeleteRecordingRequest(request_id="1", recording_id=made.recording.id)
        await made.stub.DeleteRecording(delete)
        await eventually(made.descriptors, lambda count: count == 0, "the file is closed")
        assert await refused(to_its_end(stream)) == (grpc.StatusCode.ABORTED, Reason.RECORDING_DELETED)
