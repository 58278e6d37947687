"""The product as on a robot: gateway and preview service, beside a simulated robot in its own ROS domain."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.ros_domain import ros_domain
from console.client import Credentials, GatewayClient, Unreachable
from tests.support.free import free_tcp_port, free_udp_port
from tests.support.ros import simulated_robot

UP_WITHIN_S = 30.0
_BIN = Path(sys.executable).parent


@dataclass(frozen=True, slots=True)
class Product:
    """Both programs, running.

    Attributes:
        gateway: process of the gateway.
        preview: process of the preview service.
        target: the gateway's address.
        client: an operator's connection.
    """

    gateway: subprocess.Popen[bytes]
    preview: subprocess.Popen[bytes]
    target: str
    client: GatewayClient


@contextmanager
def product(
    directory: Path, gateway: Mapping[str, Any] | None = None, credentials: Credentials | None = None
) -> Iterator[Product]:
    """Runs both programs with their default settings until the block ends; every topic has been received.

    Args:
        directory: for configuration, sockets and logs.
        gateway: settings of the gateway, besides port and socket.
        credentials: of the operator, where the settings demand them.
    """
    tcp = free_tcp_port()
    socket, target = str(directory / "preview.sock"), f"127.0.0.1:{tcp}"
    preview_settings = {"socket": socket, "source": {"kind": "test"}, "srt": {"port": free_udp_port()}}
    gateway_settings = {"grpc": {"port": tcp}, "preview": {"socket": socket}, **(gateway or {})}
    with ExitStack() as stack:
        stack.enter_context(ros_domain())
        stack.enter_context(simulated_robot(directory))
        service = stack.enter_context(serving("robot-preview", directory, preview_settings))
        server = stack.enter_context(serving("robot-gateway", directory, gateway_settings))
        client = stack.enter_context(GatewayClient(target, credentials=credentials))
        _wait_until_received(client)
        yield Product(server, service, target, client)


@contextmanager
def serving(name: str, directory: Path, settings: object) -> Iterator[subprocess.Popen[bytes]]:
    """Runs an installed program until the block ends; its log is NAME.log.

    Args:
        name: of the program.
        directory: for its configuration and log.
        settings: of its configuration.
    """
    file = directory / f"{name}.yaml"
    file.write_text(json.dumps(settings), encoding="utf-8")  # JSON is YAML
    with (directory / f"{name}.log").open("wb") as log:
        process = subprocess.Popen([_BIN / name, "serve", "--config", file], stderr=log)
        try:
            yield process
        finally:
            process.terminate()
            process.wait(10)


def _wait_until_received(client: GatewayClient) -> None:
    deadline_s = time.monotonic() + UP_WITHIN_S
    while time.monotonic() < deadline_s:
        try:
            overlay = client.overlay()
        except Unreachable:
            continue
        status = overlay.status
        sources = (status.odometry, status.vision, overlay.detections, status.platform.power.lipo_battery)
        if status.preview.service_reachable and all(source.available for source in sources):
            return
        time.sleep(0.1)
    raise RuntimeError("not all topics of the simulated robot were received")
