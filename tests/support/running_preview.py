"""A preview service for a test: the real program, called over its real socket."""

import json
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

import grpc

from omniseer.preview.v1 import preview_service_pb2 as pb
from omniseer.preview.v1 import preview_service_pb2_grpc as pb_grpc
from tests.support.free import free_udp_port
from tests.support.restartable_program import RestartableProgram
from tests.support.waiting import wait_until

ROOT = Path(__file__).parents[2]
DOUBLES_DIR = Path(__file__).parent / "encoder_doubles"
PATIENCE_S = 20.0
# Small frames save CPU time.
SMALL = {"width_px": 320, "height_px": 240}
PROFILES = {
    "low_bw": SMALL | {"fps": 15, "bitrate_kbps": 300, "floor_kbps": 100},
    "balanced": SMALL | {"fps": 30, "bitrate_kbps": 600, "floor_kbps": 150},
    "high_quality": SMALL | {"fps": 60, "bitrate_kbps": 900, "floor_kbps": 200},
}
# So that a stall of the machine is not taken for a silent camera or encoder: tests of silence state figures.
PATIENT = {"start_s": 20, "source_silence_s": 10, "encoder_silence_s": 10}
OF_A_SILENT_SOURCE = {"timeouts": {"start_s": 5, "source_silence_s": 1.5}}
"""Settings where a source falls silent: with the service's own figures."""


class NextState(Protocol):
    """See `RunningPreview.watching`."""

    def __call__(self, holds: Callable[[pb.ActualState], object], what: str) -> pb.ActualState: ...


class RunningPreview(RestartableProgram):
    """The service as a process.

    Args:
        directory: for its configuration, socket and log.
        settings: keys of the configuration that differ from the test's own: test pattern, x264, small frames,
            and time enough for every frame.
        doubles: hardware encoders to pretend, element -> how it fails (see encoder_doubles).
        cameras: devices to pretend, device -> its formats and how it fails (see camera_doubles).
        small: whether frames are smaller than those of the service's own profiles.
    """

    name = "preview"
    end_within_s = PATIENCE_S
    process: subprocess.Popen[bytes]

    def __init__(
        self,
        directory: Path,
        settings: Mapping[str, Any] | None = None,
        doubles: Mapping[str, str] | None = None,
        *,
        cameras: Mapping[str, Any] | None = None,
        small: bool = True,
    ) -> None:
        self.directory = directory
        self.port = free_udp_port()
        self.runtime_dir = directory / "run"
        self._doubles = dict(doubles or {})
        self._cameras = dict(cameras or {})
        self.revision = 0
        own: dict[str, Any] = {
            "socket": str(self.socket),
            "runtime_dir": str(self.runtime_dir),
            "source": {"kind": "test"},
            "cameras": {},
            "profiles": PROFILES if small else {},
            "srt": {"port": self.port, "bind": "127.0.0.1", "latency_ms": 20},
            "encoders": {"order": ["x264"]},
            "timeouts": PATIENT,
        }
        self._settings = _merged(own, settings or {})
        self._start()
        self._connect()

    def _connect(self) -> None:
        self.channel = grpc.insecure_channel(
            f"unix:{self.socket}", options=[("grpc.use_local_subchannel_pool", 1)]
        )
        self.stub = pb_grpc.PreviewServiceStub(self.channel)

    def _wait_until_up(self) -> None:
        # Not the file alone: whether it can be bound at all is tried with a socket that is gone again.
        wait_until(
            lambda: _listens(self.socket) or self.process.poll() is not None, "the service is up", PATIENCE_S
        )
        self.assert_alive()

    def __enter__(self) -> Self:
        self._wait_until_up()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.channel.close()
        self.end(failed=kind is not None)

    def resident_mib(self) -> float:
        """Its memory that is in RAM."""
        status = Path(f"/proc/{self.process.pid}/status").read_text(encoding="ascii")
        return int(next(line.split()[1] for line in status.splitlines() if line.startswith("VmRSS:"))) / 1024

    def start_again(self) -> None:
        """Restarts the process after its end, as a container engine does, and connects anew."""
        assert self.process.poll() is not None
        self._start()
        self._wait_until_up()
        # gRPC's own backoff, 1 s and more, is no part of the gateway's link (gateway.links.grpc_client).
        self.channel.close()
        self._connect()

    def enable(
        self, profile: pb.Profile.ValueType = pb.PROFILE_BALANCED, passphrase: str = ""
    ) -> pb.ActualState:
        """Applies a new revision that enables the preview."""
        self.revision += 1
        return self.apply(
            pb.DesiredState(revision=self.revision, enabled=True, profile=profile, passphrase=passphrase)
        )

    def disable(self) -> pb.ActualState:
        """Applies a new revision that disables the preview."""
        self.revision += 1
        return self.apply(pb.DesiredState(revision=self.revision))

    def apply(self, desired: pb.DesiredState) -> pb.ActualState:
        """Applies a desired state as it is."""
        request = pb.ApplyDesiredStateRequest(desired=desired)
        return self.stub.ApplyDesiredState(request, timeout=PATIENCE_S, wait_for_ready=True).actual

    def wait_for(
        self, holds: Callable[[pb.ActualState], object], what: str, within_s: float = PATIENCE_S
    ) -> pb.ActualState:
        """Watches the service until a condition of its state holds."""
        with self.watching(within_s) as next_state:
            return next_state(holds, what)

    @contextmanager
    def watching(self, within_s: float = PATIENCE_S) -> Iterator[NextState]:
        """Watches the service while the block lasts, so that no state between two conditions is missed.

        Yields:
            Waits for a condition among the states since the last one.
        """
        deadline = time.monotonic() + within_s
        last: pb.ActualState | None = None
        call = self.stub.WatchActualState(pb.WatchActualStateRequest(), timeout=within_s, wait_for_ready=True)

        def next_state(holds: Callable[[pb.ActualState], object], what: str) -> pb.ActualState:
            nonlocal last
            try:
                for answer in call:
                    last = answer.actual
                    if holds(last):
                        return last
                    if time.monotonic() > deadline:
                        break
            except grpc.RpcError as error:
                raise AssertionError(f"{what}: {error}; last: {last}") from error
            raise AssertionError(f"not within {within_s:g} s: {what}; last: {last}")

        try:
            yield next_state
        finally:
            call.cancel()

    def running(self, *, revision: int | None = None, within_s: float = PATIENCE_S) -> pb.ActualState:
        """Waits until frames flow."""
        return self.wait_for(
            lambda a: a.state == pb.LIFECYCLE_STATE_RUNNING and a.applied_revision >= (revision or 0),
            "running",
            within_s,
        )

    def disabled(self) -> pb.ActualState:
        """Waits until no pipeline is left."""
        return self.wait_for(lambda a: a.state == pb.LIFECYCLE_STATE_DISABLED, "disabled")

    def faulted(self, words: str = "") -> pb.ActualState:
        """Waits for a fault whose text contains `words`."""
        return self.wait_for(
            lambda a: a.state == pb.LIFECYCLE_STATE_FAULTED and words in a.last_error, f"faulted: {words}"
        )

    def _start(self) -> None:
        environment = {}
        if self._doubles or self._cameras:
            environment = {
                "PYTHONPATH": f"{DOUBLES_DIR}:{ROOT}",
                "ENCODER_DOUBLES": json.dumps(self._doubles),
                "CAMERA_DOUBLES": json.dumps(self._cameras),
            }
        self.spawn((sys.executable, "-m", "preview.cli"), self._settings, environment)


def _merged(base: dict[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    """`more` wins, section by section; sources are replaced whole."""
    merged = dict(base)
    for key, value in more.items():
        both = (
            isinstance(value, Mapping)
            and isinstance(base.get(key), dict)
            and key not in {"source", "cameras"}
        )
        merged[key] = _merged(base[key], value) if both else value
    return merged


def _listens(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX) as probe:
        return probe.connect_ex(str(path)) == 0
