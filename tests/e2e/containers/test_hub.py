"""The hub in containers, as docs/fleet.md has it: nodes, receiver, exporter, administration."""

import asyncio
import hashlib
import json
import os
import shlex
import subprocess
import sys
import urllib.request
from collections.abc import AsyncGenerator, Iterator
from contextlib import aclosing, asynccontextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final

import aiohttp
import pytest
from typer.testing import CliRunner

from bridge.uploads.receivers import Receivers
from fleet import names
from fleet.connection import FleetAddress, Hub, Published, Start, connect
from fleet.receipt_keys import confirmed, read_public_keys
from hub.cli import app as hub_app
from hub.directory import HubDirectory
from omniseer.fleet.v1.upload_pb2 import Receipt
from omniseer.gateway.v1.recording_pb2 import RecordingFile
from tests.e2e.containers.deployment import docker
from tests.support.engine import ROOT, TAG
from tests.support.fleet_values import healthy_state
from tests.support.free import free_tcp_port
from tests.support.hub_patience import in_the_end
from tests.support.s3_server import S3Server, s3_server
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.docker, pytest.mark.timeout(300)]

FILE: Final = "-f deploy/hub/compose.three.yaml"
COMPOSE: Final = f"docker compose {FILE}"
INIT: Final = "robot-bridge hub init --out fleet-hub --fleet lab --nodes 3 --host n1 --host n2 --host n3"
UP: Final = f"{COMPOSE} up -d"
APPLY: Final = f"{COMPOSE} run --rm admin apply"
ENROLL: Final = f"{COMPOSE} run --rm admin enroll lab1 --out /hub/lab1"
RECEIVER: Final = f"{COMPOSE} run --rm admin receiver-credentials --out /hub/receiver"
EXPORTER: Final = f"{COMPOSE} run --rm admin operator exporter --out /hub/exporter"
PROGRAMS_UP: Final = f"{COMPOSE} --profile receiver --profile metrics up -d"

NODES: Final = ("n1", "n2", "n3")
ROBOT: Final = "lab1"
SERVER_USER, PROGRAM_USER = 10020, 10021
UP_WITHIN_S: Final = 60.0
OVERLAY = """
services:
  n1: {{ports: !override ["127.0.0.1:{n1}:4222"]}}
  n2: {{ports: !override ["127.0.0.1:{n2}:4222"]}}
  n3: {{ports: !override ["127.0.0.1:{n3}:4222"]}}
  receiver: {{extra_hosts: ["store:host-gateway"]}}
  exporter: {{ports: !override ["127.0.0.1:{exporter}:9464"]}}
"""


@dataclass(frozen=True)
class HubInContainers:
    """The hub that runs.

    Attributes:
        home: with the administrator's directory, and the overlay that publishes free ports of this machine.
        project: of compose.
        ports: of the nodes and the exporter, by service.
        store: where recordings go.
    """

    home: Path
    project: str
    ports: dict[str, int]
    store: S3Server

    @property
    def directory(self) -> Path:
        """The administrator's."""
        return self.home / "fleet-hub"

    def type(self, command: str) -> str:
        """Runs a command of the page on this project; returns what it printed."""
        words = shlex.split(command.replace(FILE, f"{FILE} -f {self.home}/overlay.yaml"))
        environment = {
            "COMPOSE_PROJECT_NAME": self.project,
            "TAG": TAG,
            "HUB_DIR": str(self.directory),
            "RECEIVER_DIR": str(self.directory / "receiver"),
            "EXPORTER_DIR": str(self.directory / "exporter"),
        }
        done = subprocess.run(
            words,
            cwd=ROOT,
            env=os.environ | environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
        return done.stdout

    def wait_healthy(self, *services: str) -> None:
        """Waits for the containers' own health checks."""

        def healthy(service: str) -> bool:
            state = json.loads(docker("inspect", f"{self.project}-{service}-1"))[0]["State"]
            return bool(state["Health"]["Status"] == "healthy")

        for service in services:
            wait_until(partial(healthy, service), f"{service} is healthy", UP_WITHIN_S)

    def give(self, directory: Path, user: int) -> None:
        """Makes a user the owner of a directory and all that is in it: sudo chown -R."""
        for path in (directory, *directory.rglob("*")):
            os.chown(path, user, user)

    def robot(self) -> FleetAddress:
        """How the robot connects."""
        files = self.directory / ROBOT
        return FleetAddress(self._urls(), files / "bridge.creds", files / "ca.pem", names.inbox_prefix(ROBOT))

    def administrator(self) -> FleetAddress:
        """How the administration connects, from this machine."""
        return replace(HubDirectory(self.directory).address("admin"), servers=self._urls())

    def node_of(self, hub: Hub) -> str:
        """The node that a connection is to."""
        port = int(hub.link.server.rpartition(":")[2])
        return next(node for node in NODES if self.ports[node] == port)

    def _urls(self) -> tuple[str, ...]:
        return tuple(f"tls://127.0.0.1:{self.ports[node]}" for node in NODES)


@pytest.fixture(scope="module")
def hub(
    tmp_path_factory: pytest.TempPathFactory,
    images: str,  # noqa: ARG001  # for its effect
) -> Iterator[HubInContainers]:
    if os.geteuid():
        pytest.skip("giving the files to the containers' users needs root")
    # Others have to get through to it: the containers' users.
    home = tmp_path_factory.mktemp("hub")
    for path in (home, home.parent):
        path.chmod(0o755)
    ports = {service: free_tcp_port() for service in (*NODES, "exporter")}
    (home / "overlay.yaml").write_text(OVERLAY.format(**ports), encoding="utf-8")
    everywhere = "0.0.0.0"  # noqa: S104  # containers reach no server of this machine's loopback
    with s3_server(home, everywhere) as store:
        made = HubInContainers(home, f"robot-hub-e2e-{ports['n1']}", ports, store)
        init(made)
        try:
            made.type(UP)
            made.wait_healthy(*NODES)
            assert "The hub is ready" in made.type(APPLY)
            made.type(ENROLL)
            yield made
        except BaseException:
            sys.stderr.write(made.type(f"{COMPOSE} logs --tail 100"))
            raise
        finally:
            made.type(f"{COMPOSE} --profile * down --volumes --timeout 5")


def init(hub: HubInContainers) -> None:
    words = INIT.replace("fleet-hub", str(hub.directory)).split()[2:]
    done = CliRunner().invoke(hub_app, words, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    hub.give(hub.directory / "nodes", SERVER_USER)


@asynccontextmanager
async def connected(address: FleetAddress) -> AsyncGenerator[Hub, None]:
    async with connect(address) as hub:
        await hub.connected(20)
        yield hub


@pytest.mark.parametrize("command", [INIT, UP, APPLY, ENROLL, RECEIVER, EXPORTER, PROGRAMS_UP])
def test_the_page_says_what_is_typed_here(command: str) -> None:
    assert command in (ROOT / "docs/fleet.md").read_text(encoding="utf-8")


async def test_a_killed_node_costs_no_event_and_no_state(hub: HubInContainers) -> None:
    async with connected(hub.robot()) as robot:
        await robot.put(names.STATES, ROBOT, healthy_state(ROBOT).SerializeToString())
        assert (
            await robot.publish_once(names.event_subject(ROBOT, "run", 1), b"before") is Published.DELIVERED
        )
        node = hub.node_of(robot)
        await asyncio.to_thread(hub.type, f"{COMPOSE} kill {node}")
        # How long it may take is measured without containers (tests/integration/hub/test_cluster.py).
        after = partial(robot.publish_once, names.event_subject(ROBOT, "run", 2), b"after", 2.0)
        await in_the_end(after, UP_WITHIN_S)
        assert hub.node_of(robot) != node
        assert await seen(hub) == ([b"before", b"after"], healthy_state(ROBOT).SerializeToString())
    await asyncio.to_thread(hub.type, f"{COMPOSE} start {node}")
    await asyncio.to_thread(hub.wait_healthy, node)


async def seen(hub: HubInContainers) -> tuple[list[bytes], bytes]:
    """The robot's events and its state, as the hub has them."""
    async with connected(hub.administrator()) as administrator:
        # What follows outlives an election of leaders, which may still be going on.
        follow = administrator.follow(names.EVENTS, names.event_subjects(ROBOT), Start.all())
        bucket = administrator.watch_bucket(names.STATES)
        async with asyncio.timeout(UP_WITHIN_S), aclosing(follow) as events, aclosing(bucket) as states:
            return [(await anext(events)).payload for _ in range(2)], (await anext(states)).value


@pytest.fixture(scope="module")
def programs(hub: HubInContainers) -> HubInContainers:
    """The same with receiver and exporter."""
    hub.type(RECEIVER)
    hub.type(EXPORTER)
    store = hub.store.settings(public_endpoint=hub.store.url)
    port = hub.store.port
    here = "/etc/robot-hub"
    config = {
        "fleet": "lab",
        "hub": {
            "servers": [f"tls://{node}:4222" for node in NODES],
            "credentials": f"{here}/receiver.creds",
            "ca": f"{here}/ca.pem",
        },
        "store": store.model_dump(mode="json", exclude_none=True)
        | {"endpoint": f"http://store:{port}", "secret_key_file": f"{here}/store-secret"},
        "signing_key": f"{here}/receipts.key",
    }
    files = hub.directory / "receiver"
    # JSON is YAML, too.
    (files / "receiver.yaml").write_text(json.dumps(config), encoding="utf-8")
    (files / "store-secret").write_text("test\n", encoding="ascii")
    for directory in (files, hub.directory / "exporter"):
        hub.give(directory, PROGRAM_USER)
    hub.type(PROGRAMS_UP)
    hub.wait_healthy("receiver")
    return hub


async def test_the_receiver_takes_a_file_reads_it_again_and_signs(programs: HubInContainers) -> None:
    data = b"some bytes"
    digest = hashlib.sha256(data).digest()
    file = RecordingFile(name="data.bin", size=len(data), sha256=digest, final=True)
    async with connected(programs.robot()) as robot:
        receivers = Receivers(robot, ROBOT)
        begun = await receivers.begin_file("one", file)
        (url,) = await receivers.part_urls("one", file, begun.upload_id, [1])
        async with aiohttp.ClientSession() as session, session.put(url.url, data=data) as answer:
            assert answer.status == 200
            etag = answer.headers["ETag"]
        await receivers.complete_file("one", file, begun.upload_id, [etag])
        signed = await receivers.verify_file("one", file)
    keys = read_public_keys(programs.directory / ROBOT / "receipts.pub")
    expected = Receipt(
        fleet="lab", robot=ROBOT, recording_id="one", file_name=file.name, size=file.size, sha256=digest
    )
    assert confirmed(signed, keys, expected).location.startswith("s3://")


def test_the_exporter_serves_the_fleets_metrics(programs: HubInContainers) -> None:
    url = f"http://127.0.0.1:{programs.ports['exporter']}/metrics"

    def connected_to_the_hub() -> bool:
        try:
            with urllib.request.urlopen(url, timeout=5) as answer:
                return f'robot_fleet_last_seen_seconds{{robot="{ROBOT}"}}' in answer.read().decode()
        except OSError:
            return False

    wait_until(connected_to_the_hub, "the exporter knows the robot", UP_WITHIN_S)
