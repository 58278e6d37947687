"""The real recorder as a process of its own, and its calls."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import grpc
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from bench.video.foreign import end
from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.recorder.v1 import recorder_service_pb2 as recorder_pb
from omniseer.recorder.v1 import recorder_service_pb2_grpc as pb_grpc
from recorder.rpc.client import newest_state
from tests.support.answered import answered
from tests.support.restartable_program import RestartableProgram
from tests.support.waiting import wait_until

_UP_WITHIN_S: Final = 60.0
"""rclpy takes seconds to import and to join the graph, many on a machine with other things to do."""


@dataclass
class RecorderProgram(RestartableProgram):
    """A recorder in the ROS domain of the environment."""

    name = "recorder"
    end_within_s = 20

    directory: Path
    settings: dict[str, Any]
    process: subprocess.Popen[bytes] | None = None

    @property
    def root(self) -> Path:
        return self.directory / "recordings-root"

    def start(self) -> None:
        """Starts it; it serves when this returns."""
        values = {
            "socket": str(self.socket),
            "root": str(self.root),
            "room": {"min_free_bytes": 0},
            "presets": {"all": {"topics": ["*"], "exclude": ["/rosout", "/parameter_events"]}},
            **self.settings,
        }
        self.socket.unlink(missing_ok=True)
        self.spawn((sys.executable, "-c", "from recorder.cli import main; main()"), values)
        wait_until(self._serves, "the recorder serves", _UP_WITHIN_S)

    def call(self, method: str, request: Any) -> Any:
        """Calls a method and returns its response."""
        with grpc.insecure_channel(f"unix:{self.socket}") as channel:
            return getattr(pb_grpc.RecorderServiceStub(channel), method)(request, timeout=20)

    @property
    def state(self) -> recorder_pb.WatchStateResponse:
        return answered(lambda: newest_state(self.socket))

    def recording(self, recording_id: str) -> pb.Recording:
        """A recording with its files."""
        request = pb.GetRecordingRequest(recording_id=recording_id)
        found: pb.Recording = self.call("GetRecording", request).recording
        return found

    def decoded(self, made: pb.Recording, topic: str) -> list[Any]:
        """The messages of a recording's topic, by an independent reader of its final files."""
        found = []
        for reader in self._readers(made):
            found += [each.decoded_message for each in reader.iter_decoded_messages(topics=[topic])]
        return found

    def noted(self, made: pb.Recording, name: str) -> list[dict[str, str]]:
        """The metadata records of that name in a recording's final files, by the same reader."""
        return [
            each.metadata
            for reader in self._readers(made)
            for each in reader.iter_metadata()
            if each.name == name
        ]

    def _readers(self, made: pb.Recording) -> Iterator[Any]:
        for file in made.files:
            if file.name.endswith(".mcap"):
                with (self.root / "recordings" / made.id / file.name).open("rb") as content:
                    yield make_reader(content, decoder_factories=[DecoderFactory()], validate_crcs=True)

    def _serves(self) -> bool:
        self.assert_alive()
        try:
            return self.state.status.state not in (0, pb.RECORDER_STATE_RECOVERING)
        except grpc.RpcError:
            return False


@contextmanager
def recorder_program(directory: Path, **settings: Any) -> Iterator[RecorderProgram]:
    """Serving when the block begins, gone when it ends."""
    program = RecorderProgram(directory, settings)
    try:
        program.start()
        yield program
    finally:
        if program.process:
            end(program.process)
