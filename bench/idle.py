"""What it costs when nobody watches: gateway and preview service, preview off, a robot publishing."""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from unittest.mock import patch

from bench.processes import CpuShare, cpu_share, resident_mib
from bench.progress import log
from bench.rows import Row
from console.client import GatewayClient, Unreachable
from tests.support.free import free_domain, free_tcp_port, free_udp_port
from tests.support.ros import simulated_robot

UP_WITHIN_S = 30.0
SETTLE_S = 5.0
"""After the start: discovery, the trials of the encoders."""
ROUNDS = 5
WINDOW_S = 8.0
_BIN = Path(sys.executable).parent


def run(names: list[str]) -> list[Row]:
    with tempfile.TemporaryDirectory() as directory, _product(Path(directory)) as (gateway, preview):
        time.sleep(SETTLE_S)
        cpu_percent, sizes_mib = [], []
        for _ in range(ROUNDS):
            gateway_cpu, preview_cpu = _cpu_of_both(gateway.pid, preview.pid)
            sizes = resident_mib(gateway.pid), resident_mib(preview.pid)
            cpu_percent.append(gateway_cpu.whole + preview_cpu.whole)
            sizes_mib.append(sum(sizes))
            log(
                f"idle: gateway {gateway_cpu.whole:.2f} % (of it Fast DDS {gateway_cpu.middleware:.2f} %) and"
                f" {sizes[0]:.0f} MiB, preview {preview_cpu.whole:.2f} % and {sizes[1]:.0f} MiB"
            )
    rows = [
        Row(
            name="idle.cpu",
            what="gateway and preview service together, preview off, a robot publishing on all its topics",
            unit="% of a core",
            values=cpu_percent,
            bar=8,
        ),
        Row(
            name="idle.rss_mib",
            what="resident memory of both in the same state",
            unit="MiB",
            values=sizes_mib,
            bar=220,
        ),
    ]
    return [row for row in rows if not names or row.name in names]


def _cpu_of_both(gateway: int, preview: int) -> tuple[CpuShare, CpuShare]:
    """One window after the other: reading /proc for one must not count for the other."""
    return cpu_share(gateway, WINDOW_S), cpu_share(preview, WINDOW_S)


@contextmanager
def _product(directory: Path) -> Iterator[tuple[subprocess.Popen[bytes], subprocess.Popen[bytes]]]:
    """Both programs beside a simulated robot in a ROS domain of their own; every topic has been heard."""
    tcp = free_tcp_port()
    socket = str(directory / "preview.sock")
    preview = {"socket": socket, "source": {"kind": "test"}, "srt": {"port": free_udp_port()}}
    gateway = {"grpc": {"port": tcp}, "preview": {"socket": socket}}
    with ExitStack() as running:
        domain = running.enter_context(free_domain())
        ros = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        running.enter_context(patch.dict(os.environ, ros))
        running.enter_context(simulated_robot(directory))
        service = running.enter_context(_program("robot-preview", directory, preview))
        door = running.enter_context(_program("robot-gateway", directory, gateway))
        client = running.enter_context(GatewayClient(f"127.0.0.1:{tcp}"))
        _wait_until_heard(client)
        yield door, service


@contextmanager
def _program(name: str, directory: Path, settings: object) -> Iterator[subprocess.Popen[bytes]]:
    file = directory / f"{name}.yaml"
    file.write_text(json.dumps(settings), encoding="utf-8")  # JSON is YAML
    with (directory / f"{name}.log").open("wb") as log:
        process = subprocess.Popen([_BIN / name, "serve", "--config", file], stderr=log)
        try:
            yield process
        finally:
            process.terminate()
            process.wait(10)


def _wait_until_heard(client: GatewayClient) -> None:
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
    raise RuntimeError("not all topics of the simulated robot were heard")
