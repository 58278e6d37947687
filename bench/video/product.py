"""What we measure: the preview service behind the gateway, as on a robot, and the reference receiver."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from bench.video import foreign
from bench.video.camera import Camera
from console.client import GatewayClient, PreviewProfile, PreviewState, Unreachable
from console.receiver.address import StreamAddress
from tests.support.free import free_tcp_port, free_udp_port
from tests.support.receiver import Receiver

_UP_WITHIN_S = 20.0
_PROGRAMS = Path(sys.executable).parent


@dataclass(frozen=True, slots=True)
class Robot:
    """Gateway and preview service, running.

    Args:
        client: an operator's connection.
        service: the preview service's process.
        address: where its stream is while it is on.
    """

    client: GatewayClient
    service: subprocess.Popen[bytes]
    address: StreamAddress

    def viewer(self) -> Receiver:
        """Begins to watch."""
        return Receiver(self.address, queue_size=4)

    @contextmanager
    def preview(self, profile: PreviewProfile = PreviewProfile.BALANCED) -> Iterator[None]:
        """Has the preview on until the block ends."""
        change = self.client.enable_preview(profile)
        if change.preview.state is not PreviewState.RUNNING:
            raise RuntimeError(f"the preview does not run: {change.message}")
        try:
            yield
        finally:
            self.client.disable_preview()


@contextmanager
def robot(
    workdir: Path, source: Camera, latency_ms: int, *, host: str = "127.0.0.1", adaptive: bool = False
) -> Iterator[Robot]:
    """Runs both programs until the block ends; their logs go to standard error.

    Args:
        workdir: for configuration and sockets.
        source: what they show.
        latency_ms: of SRT.
        host: the address that viewers call.
        adaptive: whether the bit rate follows the link.
    """
    name = f"{latency_ms}-{source.fps}-{'adaptive' if adaptive else 'fixed'}"
    socket, udp, tcp = workdir / f"{name}.sock", free_udp_port(), free_tcp_port()
    preview = {
        "socket": str(socket),
        "log_level": "warning",
        "source": {"kind": "gst", "description": source.source},
        "srt": {"bind": host, "port": udp, "latency_ms": latency_ms},
        "encoders": {"order": ["x264"]},
        "adaptive": {"enabled": adaptive},
        # Watchdogs are not what is measured: a machine that is busy otherwise must not end a long run.
        "timeouts": {"start_s": 20, "source_silence_s": 10, "encoder_silence_s": 10},
        "runtime_dir": str(workdir / name),
    }
    gateway = {
        "log_level": "warning",
        "grpc": {"port": tcp},
        # Plain, as the reference is, also where the listener is not on loopback.
        "preview": {"socket": str(socket), "encrypted": False},
        "sources": [],
    }
    with (
        _program("robot-preview", workdir / f"preview-{name}.yaml", preview) as service,
        _program("robot-gateway", workdir / f"gateway-{name}.yaml", gateway),
        GatewayClient(f"127.0.0.1:{tcp}") as client,
    ):
        _wait_until_ready(client)
        # Once on and off: what is tried and remembered at the first start is not what we measure.
        found = Robot(client, service, StreamAddress(host, udp, latency_ms))
        with found.preview():
            pass
        yield found


def _wait_until_ready(client: GatewayClient) -> None:
    deadline_s = time.monotonic() + _UP_WITHIN_S
    while True:
        try:
            if client.status().preview.service_reachable:
                return
        except Unreachable:
            if time.monotonic() > deadline_s:
                raise
        if time.monotonic() > deadline_s:
            raise RuntimeError("the gateway does not reach the preview service")
        time.sleep(0.05)


@contextmanager
def _program(name: str, file: Path, settings: object) -> Iterator[subprocess.Popen[bytes]]:
    # JSON is YAML.
    file.write_text(json.dumps(settings), encoding="utf-8")
    with foreign.running(str(_PROGRAMS / name), "serve", "--config", str(file), own=True) as process:
        yield process
