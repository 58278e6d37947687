"""The real recorder as a process of its own, and its calls."""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import grpc

from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.recorder.v1 import recorder_service_pb2 as recorder_pb
from omniseer.recorder.v1 import recorder_service_pb2_grpc as pb_grpc
from recorder.rpc.client import newest_state
from tests.support.waiting import wait_until

_ROOT: Final = Path(__file__).parents[2]
_UP_WITHIN_S: Final = 60.0
"""rclpy takes seconds to import and to join the graph, many on a machine with other things to do."""


@dataclass
class RecorderProgram:
    """A recorder in the ROS domain of the environment, which may be killed and started again."""

    directory: Path
    settings: dict[str, Any]
    process: subprocess.Popen[bytes] | None = None

    @property
    def root(self) -> Path:
        return self.directory / "recordings-root"

    @property
    def socket(self) -> Path:
        return self.directory / "recorder.sock"

    @property
    def log(self) -> Path:
        return self.directory / "recorder.log"

    def start(self) -> None:
        """Starts it; it serves when this returns."""
        config = self.directory / "recorder.yaml"
        values = {
            "socket": str(self.socket),
            "root": str(self.root),
            "room": {"min_free_bytes": 0},
            "presets": {"all": {"topics": ["*"], "exclude": ["/rosout", "/parameter_events"]}},
            **self.settings,
        }
        config.write_text(json.dumps(values), encoding="utf-8")  # JSON is YAML
        self.socket.unlink(missing_ok=True)
        code = "from recorder.cli import main; main()"
        command = [sys.executable, "-c", code, "serve", "--config", str(config)]
        with self.log.open("ab") as output:
            self.process = subprocess.Popen(command, cwd=_ROOT, stderr=output)
        wait_until(self._serves, "the recorder serves", _UP_WITHIN_S)

    def kill(self) -> None:
        """Ends it without warning."""
        assert self.process
        self.process.kill()
        self.process.wait()

    def stop(self) -> int:
        """Ends it in order; returns its exit code."""
        assert self.process
        self.process.terminate()
        try:
            return self.process.wait(20)
        except subprocess.TimeoutExpired:
            self.kill()
            raise

    def call(self, method: str, request: Any) -> Any:
        """Calls a method and returns its response."""
        with grpc.insecure_channel(f"unix:{self.socket}") as channel:
            return getattr(pb_grpc.RecorderServiceStub(channel), method)(request, timeout=20)

    @property
    def state(self) -> recorder_pb.WatchStateResponse:
        return newest_state(self.socket)

    def recording(self, recording_id: str) -> pb.Recording:
        """A recording with its files."""
        request = pb.GetRecordingRequest(recording_id=recording_id)
        found: pb.Recording = self.call("GetRecording", request).recording
        return found

    def _serves(self) -> bool:
        assert self.process
        assert self.process.poll() is None, self.log.read_text(encoding="utf-8")[-2000:]
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
            program.process.terminate()
            with suppress(subprocess.TimeoutExpired):
                program.process.wait(10)
            program.kill()
