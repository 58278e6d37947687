"""A robot with a recording that can be copied: robot-recorder and robot-gateway, as processes."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bench.export.copying import METHOD, Stream
from bench.ros_domain import ros_domain
from console.client import GatewayClient, Recording
from omniseer.gateway.v1 import recording_pb2 as pb
from recorder.recording.requests import StartOptions
from tests.support.gateway_program import GatewayProgram, gateway_program
from tests.support.recorder_in_process import Source, running_recorder
from tests.support.running_recorder import RecorderProgram, recorder_program
from tests.support.waiting import wait_until

SIZE: Final = 128 * 1024 * 1024
_MESSAGE_BYTES: Final = 512 * 1024
_AHEAD: Final = 32
"""Messages in the recorder's queue at most: 16 MiB of the 64 that it takes."""


@dataclass(frozen=True, slots=True)
class ExportingRobot:
    """The robot, and its only recording.

    Attributes:
        directory: for configuration, sockets and logs.
    """

    directory: Path
    recorder: RecorderProgram
    gateway: GatewayProgram
    recording: Recording

    @property
    def target(self) -> str:
        """Address of the gateway."""
        return f"127.0.0.1:{self.gateway.port}"

    def streams(self, max_bytes_per_s: int = 0) -> list[Stream]:
        """Returns a call for each file of the recording; together they copy all of it."""
        requests = [
            pb.ExportRecordingRequest(
                recording_id=self.recording.id, file=each.name, max_bytes_per_s=max_bytes_per_s
            )
            for each in self.recording.files
        ]
        return [Stream(METHOD, each.SerializeToString()) for each in requests]

    @property
    def paths(self) -> list[Path]:
        """The same files on the robot's disk."""
        folder = self.recorder.root / "recordings" / self.recording.id
        return [folder / each.name for each in self.recording.files]


@contextmanager
def exporting_robot(directory: Path, size: int = SIZE) -> Iterator[ExportingRobot]:
    """Yields a robot whose recording has about that many bytes, which do not compress."""
    recorder = RecorderProgram(directory, {})
    asyncio.run(_record(recorder.root, size))
    with (
        ros_domain(),
        recorder_program(directory) as running,
        gateway_program(directory, sources=[], recording={"socket": str(running.socket)}) as gateway,
        GatewayClient(f"127.0.0.1:{gateway.port}") as client,
    ):
        wait_until(lambda: gateway.status().recording.recordings, "the gateway knows the recording")
        (listed,) = client.recordings()
        yield ExportingRobot(directory, running, gateway, client.recording(listed.id))


async def _record(root: Path, size: int) -> None:
    async with running_recorder(root) as running:
        await running.operations.start("start", StartOptions(label="bench"))
        source = Source(running.queue)
        for number in range(1, size // _MESSAGE_BYTES + 1):
            source.send(size=_MESSAGE_BYTES)
            if number % _AHEAD == 0:
                await running.written(number)
        await running.written(source.sent)
        await running.operations.stop("stop", "")
