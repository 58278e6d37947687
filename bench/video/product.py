"""The product under measurement: the preview service behind the gateway, as on a robot."""

import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from bench.video import foreign
from bench.video.camera import Camera
from console.client import GatewayClient, PreviewProfile, PreviewState, Unreachable
from console.receiver.address import StreamAddress
from console.receiver.delivery import DeliveryChoice
from console.receiver.options import ReceiverOptions
from tests.support.free import free_tcp_port, free_udp_port
from tests.support.receiver import Receiver
from tests.support.udp_link import Impairment, UdpLink

if TYPE_CHECKING:
    import subprocess

HOST: Final = "127.0.0.1"
FAR_HOST: Final = "127.0.0.2"
"""Address of the relay to a robot that is far away; its port is that of the stream."""
DIRECT_DELIVERY: Final = ReceiverOptions(delivery=DeliveryChoice.DIRECT)
SRT_DELIVERY: Final = ReceiverOptions(delivery=DeliveryChoice.SRT)
"""Packets at SRT's latency, as every other SRT player takes them: rows that compare latencies say so."""
_UP_WITHIN_S: Final = 20.0
_PROGRAMS: Final = Path(sys.executable).parent
_WITHOUT_WATCHDOGS: Final = {"start_s": 20, "source_silence_s": 10, "encoder_silence_s": 10}
"""A machine that is busy otherwise must not end a long run."""


class Service:
    """The preview service's process.

    Args:
        command: program and arguments.
        environment: of the process, besides this one's.
    """

    def __init__(self, command: tuple[str, ...], environment: Mapping[str, str]) -> None:
        self._command = command
        self._environment = environment
        self.process = self._spawn()

    @property
    def pid(self) -> int:
        """Process ID."""
        return self.process.pid

    def start_again(self) -> None:
        """Restarts the process after its end, as a container engine does."""
        self.process = self._spawn()

    def _spawn(self) -> "subprocess.Popen[bytes]":
        return foreign.spawn(*self._command, own=True, more=self._environment)


FIXED_RATE: Final = {"adaptive": {"enabled": False}}
"""Settings for rows in which the reference sends at the profile's bit rate from the first frame on: the
adaptive one starts low with the first viewer, and fewer bits cost less."""


@dataclass(frozen=True, slots=True)
class Robot:
    """Gateway and preview service, running.

    Args:
        client: an operator's connection.
        service: the preview service.
        address: of its stream while it is on.
    """

    client: GatewayClient
    service: Service
    address: StreamAddress

    def viewer(self, options: ReceiverOptions = SRT_DELIVERY) -> Receiver:
        """Connects the product's receiver; by default with SRT's own delivery, as the reference has it."""
        return Receiver(self.address, queue_size=4, options=options)

    def link(self, impairment: Impairment, seed: int, tap: Callable[[bytes], None] | None = None) -> UdpLink:
        """Returns a link with such properties at `FAR_HOST`; the same seed loses the same packets.

        Args:
            impairment: its properties.
            seed: of the losses.
            tap: takes what the robot sends; see `UdpLink`.
        """
        return UdpLink(self.address.port, impairment, seed, at=(FAR_HOST, self.address.port), tap=tap)

    @contextmanager
    def preview(self, profile: PreviewProfile = PreviewProfile.BALANCED) -> Iterator[None]:
        """Enables the preview until the block ends.

        Raises:
            RuntimeError: it does not run.
        """
        change = self.client.enable_preview(profile)
        if change.preview.state is not PreviewState.RUNNING:
            raise RuntimeError(f"the preview does not run: {change.message}")
        try:
            yield
        finally:
            self.client.disable_preview()


@contextmanager
def robot(
    workdir: Path,
    source: Camera | None,
    latency_ms: int,
    *,
    settings: Mapping[str, Any] | None = None,
    environment: Mapping[str, str] | None = None,
    warm: bool = True,
    far: bool = False,
) -> Iterator[Robot]:
    """Runs both programs until the block ends; their logs go to standard error.

    Args:
        workdir: for configuration and sockets.
        source: the camera; None for the service's own test pattern.
        latency_ms: SRT latency.
        settings: sections of the preview service's configuration that replace those of the benchmarks:
            x264, and watchdogs that are out of the way.
        environment: of the preview service, besides this process's.
        warm: whether the preview is enabled and disabled once first, so that what happens only at the first
            start after the service's own is not measured.
        far: whether viewers that follow its status connect over a link at `FAR_HOST` (see `Robot.link`).
    """
    udp, tcp = free_udp_port(), free_tcp_port()
    socket = workdir / f"preview-{udp}.sock"
    preview = {
        "socket": str(socket),
        "log_level": "warning",
        "source": {"kind": "gst", "description": source.source} if source else {"kind": "test"},
        "srt": {"bind": HOST, "port": udp, "latency_ms": latency_ms},
        "encoders": {"order": ["x264"]},
        "timeouts": _WITHOUT_WATCHDOGS,
        "runtime_dir": str(workdir / f"preview-{udp}"),
    } | dict(settings or {})
    gateway = {
        "log_level": "warning",
        "grpc": {"port": tcp},
        # Plain, as the reference is, also where the listener is not on loopback.
        "preview": {"socket": str(socket), "encrypted": False}
        | ({"advertised_host": FAR_HOST} if far else {}),
        "sources": [],
    }
    service = Service(_command("robot-preview", workdir / f"preview-{udp}.yaml", preview), environment or {})
    try:
        with (
            foreign.running(*_command("robot-gateway", workdir / f"gateway-{udp}.yaml", gateway), own=True),
            GatewayClient(f"{HOST}:{tcp}") as client,
        ):
            _wait_until_ready(client)
            found = Robot(client, service, StreamAddress(HOST, udp, latency_ms))
            if warm:
                with found.preview():
                    pass
            yield found
    finally:
        foreign.end(service.process)


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


def _command(name: str, file: Path, settings: object) -> tuple[str, ...]:
    """Writes a program's configuration and returns how it is started."""
    file.write_text(json.dumps(settings), encoding="utf-8")  # JSON is YAML
    return str(_PROGRAMS / name), "serve", "--config", str(file)
