"""The way to the fleet in containers: gateway, bridge and nats-server, each killed and started again."""

import asyncio
import json
import os
import re
import shutil
import signal
from collections.abc import Awaitable, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import pytest
from typer.testing import CliRunner

from console.client.blocking import GatewayClient
from console.client.errors import GatewayError
from console.client.results import CaughtUp, CloudState, CloudStatus, EventPosition
from console.credentials import Credentials
from fleet import names
from fleet.connection import Hub, connect
from hub.cli import app as hub_app
from hub.directory import HubDirectory
from omniseer.fleet.v1.state_pb2 import RobotState
from tests.e2e.containers.credentials import added, knows, typed
from tests.e2e.containers.deployment import (
    Deployment,
    demo_overlay,
    deployed,
    mounts,
    status_with,
    writable,
)
from tests.support.engine import ROOT
from tests.support.free import free_tcp_port
from tests.support.running_bridge import Received, received
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.docker, pytest.mark.timeout(900)]

ResultT = TypeVar("ResultT")
ROBOT, FLEET = "lab1", "lab"
BRIDGE, NATS = (10005, 10000), 10020
UP = "docker compose up -d"
INIT = "docker compose run --rm -T credentials init --host gateway --host 127.0.0.1"
ADD = "docker compose run --rm -T credentials add bridge --role viewer"
ROTATE = "docker compose run --rm -T credentials rotate bridge"
DOCTOR = "docker compose exec bridge robot-bridge doctor"
BACK_WITHIN_S = 90.0

OVERLAY = """
services:
  nats:
    extends: {{file: {root}/deploy/hub/compose.yaml, service: nats}}
    networks: !override [graph]
    ports: !override ["127.0.0.1:{port}:4222"]
  gateway:
    environment: {{GATEWAY__METRICS__PORT: "9464"}}
volumes:
  nats-data:
"""
CONFIG = f"""
hub:
  servers: ["tls://nats:4222"]
  robot: {ROBOT}
  fleet: {FLEET}
  credentials: /etc/robot-bridge/bridge.creds
  ca: /etc/robot-bridge/ca.pem
  receipts: /etc/robot-bridge/receipts.pub
"""
SOURCES = """
sources:
  - {kind: odometry, topic: /odometry/filtered, type: nav_msgs/msg/Odometry, required: true}
  - {kind: vision, topic: /vision/perf, type: omniseer_msgs/msg/VisionPerfSummary, required: true}
  - {kind: mode, topic: /mission/mode, type: std_msgs/msg/String, reliability: reliable,
     durability: transient_local}
"""
MODES = """
import sys, time, uuid
from pathlib import Path
from simrobot.control import ask
for _ in range(int(sys.argv[1])):
    ask(Path("/tmp/robot.sock"), {"mode": uuid.uuid4().hex})
    time.sleep(0.5)  # Slower than robot and gateway look.
"""
METRICS = (
    "import urllib.request as r; print(r.urlopen('http://127.0.0.1:9464/metrics', timeout=5).read().decode())"
)


@dataclass(frozen=True)
class Fleet:
    """A robot in a fleet.

    Attributes:
        directory: the hub's.
        files: the folder that the bridge reads.
        refused: what the first start ended with, before there was an enrolment, and what its log said.
        anna: an operator's credentials.
    """

    deployment: Deployment
    directory: Path
    files: Path
    refused: tuple[int, str]
    anna: Credentials

    def at_hub(self, work: Callable[[Hub], Awaitable[ResultT]]) -> ResultT:
        """The result of some work with the hub, as its administration does it."""

        async def connected() -> ResultT:
            async with connect(HubDirectory(self.directory).address("admin")) as hub:
                await hub.connected(30)
                return await work(hub)

        return asyncio.run(connected())

    def received(self) -> Received:
        """All events that the hub has of the robot."""
        return self.at_hub(lambda hub: received(hub, ROBOT))

    def state(self) -> RobotState | None:
        """The robot's state, as the hub has it."""
        entry = self.at_hub(lambda hub: hub.entries(names.STATES)).get(ROBOT)
        return RobotState.FromString(entry.value) if entry else None

    def client(self) -> GatewayClient:
        """Anna."""
        return self.deployment.client(self.anna)

    def put(self, name: str, content: str) -> None:
        """Puts a file where the bridge reads it, as docs/fleet.md says: its own, and no one else's."""
        file = self.files / f"{name}.new"
        file.write_text(content, encoding="utf-8")
        file.chmod(0o600)
        os.chown(file, *BRIDGE)
        file.replace(self.files / name)


def hub_command(*words: str) -> None:
    done = CliRunner().invoke(hub_app, words, catch_exceptions=False)
    assert done.exit_code == 0, done.output


def new_hub(directory: Path, port: int) -> None:
    """The hub's directory; its administration reaches the server by this machine's port."""
    hub_command("init", "--out", str(directory), "--fleet", FLEET, "--host", "nats")
    record = json.loads((directory / "hub.json").read_text(encoding="utf-8"))
    record["servers"] = [f"tls://127.0.0.1:{port}"]
    (directory / "hub.json").write_text(json.dumps(record), encoding="utf-8")
    for path in (directory / "nodes", *(directory / "nodes").rglob("*")):
        os.chown(path, NATS, NATS)


@pytest.fixture(scope="module")
def fleet(
    tmp_path_factory: pytest.TempPathFactory,
    images: str,  # noqa: ARG001  # for its effect
) -> Iterator[Fleet]:
    if os.geteuid():
        pytest.skip("giving the files to the containers' users needs root")
    # Others have to get through to it: the containers' users.
    home = tmp_path_factory.mktemp("bridge")
    for path in (home, home.parent):
        path.chmod(0o755)
    directory, files, port = home / "hub", home / "files", free_tcp_port()
    new_hub(directory, port)
    files.mkdir(mode=0o755)
    (home / "gateway.yaml").write_text(SOURCES, encoding="utf-8")
    (home / "bridge.yaml").write_text(CONFIG, encoding="utf-8")
    (home / "overlay.yaml").write_text(OVERLAY.format(root=ROOT, port=port), encoding="utf-8")
    overlays = (demo_overlay(), str(ROOT / "compose.guarded.yaml"), str(home / "overlay.yaml"))
    with deployed(
        home,
        *overlays,
        up=False,
        COMPOSE_PROFILES="bridge",
        ROBOT_IN_FLEET="true",
        GATEWAY_CONFIG=str(home / "gateway.yaml"),
        BRIDGE_CONFIG=str(home / "bridge.yaml"),
        BRIDGE_FILES=str(files),
        HUB_DIR=str(directory),
    ) as deployment:
        begun = typed(deployment, INIT)
        assert begun.returncode == 0, begun.stderr
        early = typed(deployment, UP)
        refused = (early.returncode, deployment.logs("bridge-config").strip())
        deployment.run("up", "-d", "nats")
        deployment.wait_healthy("nats")
        hub_command("apply", "--dir", str(directory))
        hub_command("enroll", ROBOT, "--dir", str(directory), "--out", str(home / "enrolment"))
        made = Fleet(deployment, directory, files, refused, added(deployment, "anna", "operator"))
        for name in ("bridge.creds", "ca.pem", "receipts.pub"):
            made.put(name, (home / "enrolment" / name).read_text(encoding="utf-8"))
        shutil.rmtree(home / "enrolment")
        made.put("gateway.login", typed(deployment, ADD).stdout)
        up = typed(deployment, UP)
        assert up.returncode == 0, up.stderr + deployment.logs("bridge-config")
        with made.client() as robot:
            wait_until(lambda: knows(robot), "the gateway knows its operator", BACK_WITHIN_S)
            deployment.wait_for_status(robot)
        yield made


@pytest.fixture
def connected(fleet: Fleet) -> Fleet:
    """The same, and nothing waits for the hub."""
    wait_until(lambda: settled(fleet), "the robot is connected and has sent all", BACK_WITHIN_S)
    return fleet


def cloud_of(fleet: Fleet) -> CloudStatus | None:
    """The connection as the robot's own operators see it; None while the gateway does not answer."""
    with fleet.client() as robot:
        try:
            return robot.status().cloud
        except GatewayError:
            return None


def wait_until_cloud(fleet: Fleet, holds: Callable[[CloudStatus], bool], what: str) -> CloudStatus:
    """Waits for something of the connection, and returns it as it was then."""

    def asked() -> CloudStatus | None:
        cloud = cloud_of(fleet)
        return cloud if cloud and holds(cloud) else None

    return wait_until(asked, what, BACK_WITHIN_S)


def settled(fleet: Fleet) -> bool:
    cloud = cloud_of(fleet)
    return bool(
        cloud
        and cloud.state is CloudState.CONNECTED
        and not (cloud.outbox_events or cloud.last_error)
        and all_there(fleet)
    )


def issued(fleet: Fleet) -> EventPosition:
    """How many events the gateway's present run has issued."""
    with fleet.client() as robot:
        events = robot.events()
        return next(item.position for item in events if isinstance(item, CaughtUp))


def all_there(fleet: Fleet) -> bool:
    """Whether the hub has, or has a gap for, each event of the gateway's present run; none twice."""
    position = issued(fleet)
    found = fleet.received()
    newest = max((number for run, number in found.events if run == position.run_id), default=0)
    # More may have happened since; what was issued then has to be there.
    return newest >= position.sequence and found.add_up_to(position.run_id, newest)


def change_modes(fleet: Fleet, times: int) -> None:
    """Has the robot report other modes, of which each is an event."""
    with fleet.client() as robot:
        wait_until(lambda: knows(robot), "the gateway answers", BACK_WITHIN_S)
        # Of what is published before the gateway has discovered the topic it gets the newest alone.
        status_with(robot, lambda it: it.mission.available, "the gateway hears the mode", BACK_WITHIN_S)
    before, published = issued(fleet), 0

    def reported() -> bool:
        nonlocal published
        # Modes that come while robot or gateway stands still are one event.
        missing = times - issued_since(fleet, before)
        if missing > 0:
            assert published <= 2 * times, "the gateway loses modes"
            fleet.deployment.run("exec", "robot", "python", "-c", MODES, str(missing))
            published += missing
        return missing <= 0

    wait_until(reported, "the gateway reports them", BACK_WITHIN_S)


def issued_since(fleet: Fleet, before: EventPosition) -> int:
    now = issued(fleet)
    return now.sequence - (before.sequence if now.run_id == before.run_id else 0)


@pytest.mark.parametrize("command", [ADD, ROTATE, DOCTOR])
def test_the_page_says_what_is_typed_here(command: str) -> None:
    assert command in (ROOT / "docs/fleet.md").read_text(encoding="utf-8")


def test_without_an_enrolment_the_start_ends_with_one_line_that_says_what_to_do(fleet: Fleet) -> None:
    code, said = fleet.refused
    assert code != 0
    assert len(said.splitlines()) == 1, said
    assert "/etc/robot-bridge/" in said
    assert "can't be read: No such file or directory" in said
    assert "Traceback" not in said


def test_state_and_events_are_at_the_hub_and_the_status_shows_the_connection(connected: Fleet) -> None:
    state = wait_until(connected.state, "the hub has its state")
    assert (state.robot, state.gateway_reachable) == (ROBOT, True)
    position = issued(connected)
    assert state.gateway_run_id == position.run_id
    change_modes(connected, 3)
    wait_until(lambda: all_there(connected), "what happened is at the hub")
    cloud = cloud_of(connected)
    assert cloud
    assert (cloud.state, cloud.robot, cloud.fleet) == (CloudState.CONNECTED, ROBOT, FLEET)
    assert (cloud.events_dropped, cloud.last_error) == (0, "")


def test_prometheus_gets_the_bridges_metrics_of_the_gateway(connected: Fleet) -> None:
    scraped = connected.deployment.run("exec", "gateway", "python", "-c", METRICS).stdout
    assert 'robot_gateway_cloud_state{state="connected"} 1.0' in scraped
    assert "robot_gateway_bridge_link_failures 0.0" in scraped
    sent = re.search(r"^robot_gateway_cloud_events_sent_total (\S+)$", scraped, re.MULTILINE)
    assert sent
    assert float(sent[1]) > 0


def test_a_killed_bridge_is_started_again_and_loses_and_repeats_nothing(connected: Fleet) -> None:
    robot = connected.deployment
    run_id, before = issued(connected).run_id, robot.restarts("bridge")
    with ThreadPoolExecutor(1) as pool:
        events = pool.submit(change_modes, connected, 20)
        for restarts in range(before + 1, before + 4):
            robot.signal_all("bridge", signal.SIGKILL)
            wait_until(partial(restarted, robot, restarts), "the engine starts it", BACK_WITHIN_S)
            wait_until(partial(all_there, connected), "all is at the hub, each once", BACK_WITHIN_S)
        events.result(BACK_WITHIN_S)
    wait_until(partial(all_there, connected), "all is at the hub, each once", BACK_WITHIN_S)
    assert issued(connected).run_id == run_id
    found, first = connected.received(), first_event(connected, run_id)
    missing = [number for run, number in found.missing if run == run_id and number > first]
    assert not missing, "nothing is missing but what was before the outbox was made"


def restarted(robot: Deployment, times: int) -> bool:
    """Whether it runs again; the engine counts a restart when it begins to pause before it."""
    return robot.restarts("bridge") >= times and robot.inspect("bridge")["State"]["Status"] == "running"


def first_event(fleet: Fleet, run_id: str) -> int:
    """The first event of a run that the hub has."""
    return min(number for run, number in fleet.received().events if run == run_id)


def test_a_killed_gateway_begins_a_new_run_and_what_it_had_issued_is_there(connected: Fleet) -> None:
    robot, before = connected.deployment, issued(connected)
    change_modes(connected, 5)
    # What happens later need not be at the hub before the gateway is killed.
    last = issued(connected)
    wait_until(lambda: all_there(connected), "what happened is at the hub", BACK_WITHIN_S)
    robot.signal_all("gateway", signal.SIGKILL)
    wait_until(lambda: robot.restarts("gateway"), "the engine starts it", BACK_WITHIN_S)
    change_modes(connected, 5)
    wait_until(lambda: settled(connected), "the bridge has come back by itself", BACK_WITHIN_S)
    now = issued(connected)
    assert now.run_id != before.run_id
    found = connected.received()
    assert found.add_up_to(last.run_id, max(number for run, number in found.events if run == last.run_id))
    assert (last.run_id, last.sequence) in found.events
    assert {1, 2, 3} <= {number for run, number in found.events if run == now.run_id}, "from its beginning"
    assert robot.restarts("bridge") == 0 or connected.state(), "the bridge outlived it"


def test_events_wait_while_the_hub_is_gone(connected: Fleet) -> None:
    robot = connected.deployment
    position = issued(connected)
    robot.run("kill", "nats")
    change_modes(connected, 10)
    wait_until_cloud(connected, lambda cloud: cloud.outbox_events >= 10, "they wait in the outbox")
    # Its outbox is on the disk: a new container has it, too.
    robot.run("up", "-d", "--force-recreate", "--no-deps", "bridge")
    offline = wait_until_cloud(
        connected, lambda cloud: cloud.state is CloudState.OFFLINE, "the status says so"
    )
    assert offline.last_error
    robot.run("start", "nats")
    wait_until(lambda: settled(connected), "all is at the hub, each once", BACK_WITHIN_S)
    assert issued(connected).run_id == position.run_id


def test_a_new_login_takes_effect_without_a_restart(connected: Fleet) -> None:
    robot = connected.deployment
    begun = robot.inspect("bridge")["State"]["StartedAt"]
    rotated = typed(robot, ROTATE)
    assert rotated.returncode == 0, rotated.stderr
    refused = wait_until_cloud(
        connected, lambda cloud: "revoked" in cloud.last_error, "the status says that it is refused"
    )
    assert "credentials rotate" in refused.last_error
    doctor = typed(robot, DOCTOR)
    assert doctor.returncode == 1
    assert "credentials rotate" in doctor.stdout
    change_modes(connected, 3)
    connected.put("gateway.login", rotated.stdout)
    wait_until(lambda: settled(connected), "it goes on, and nothing is lost", BACK_WITHIN_S)
    assert robot.inspect("bridge")["State"]["StartedAt"] == begun
    assert typed(robot, DOCTOR).returncode == 0, typed(robot, DOCTOR).stdout
    secret = rotated.stdout.partition("token: ")[2].splitlines()[0]
    assert secret
    assert secret not in robot.run("logs").stdout


def status_fields(pid: int) -> dict[str, str]:
    lines = Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines()
    return {name: value.strip() for name, _, value in (line.partition(":") for line in lines)}


def test_the_bridge_is_an_ordinary_user_that_can_write_its_outbox_and_its_socket(connected: Fleet) -> None:
    pid = connected.deployment.program_pid("bridge")
    fields = status_fields(pid)
    user, group = BRIDGE
    assert (set(fields["Uid"].split()), set(fields["Gid"].split())) == ({str(user)}, {str(group)})
    assert all(int(fields[kind], 16) == 0 for kind in ("CapInh", "CapPrm", "CapEff", "CapBnd", "CapAmb"))
    assert (fields["NoNewPrivs"], fields["Seccomp"]) == ("1", "2")
    assert writable(pid) == {"/tmp", "/run/robot-bridge", "/var/lib/robot-bridge", "/dev/shm"}
    mounted = mounts(pid)
    for path in ("/", "/etc/robot-bridge", "/etc/robot-gateway/bridge.yaml"):
        assert "ro" in mounted[path], path
    for path in ("/tmp", "/run/robot-bridge"):
        assert {"noexec", "nosuid", "nodev"} <= mounted[path], path
    root = Path(f"/proc/{pid}/root")
    for path, mode in (("tmp", 0o700), ("var/lib/robot-bridge", 0o700), ("run/robot-bridge", 0o750)):
        found = (root / path).stat()
        assert (found.st_mode & 0o777, found.st_uid, found.st_gid) == (mode, *BRIDGE), path


def test_the_image_knows_the_zones_of_hours_and_says_when_none_is_set(connected: Fleet) -> None:
    check = ("run", "--rm", "--no-deps", "-T", "-e", 'BRIDGE__UPLOADS__HOURS=["22:00-06:00"]')
    zone = ("-e", "BRIDGE__UPLOADS__TIME_ZONE=Asia/Tokyo")
    said = connected.deployment.run(*check, *zone, "bridge-config").stderr
    assert "(Asia/Tokyo); uploads are allowed at 22:00-06:00" in said
    assert "Set uploads.time_zone" not in said
    said = connected.deployment.run(*check, "bridge-config").stderr
    assert "(UTC); uploads are allowed at 22:00-06:00" in said
    assert "Set uploads.time_zone" in said


def test_it_listens_on_no_port(connected: Fleet) -> None:
    pid = connected.deployment.program_pid("bridge")
    for table in ("tcp", "tcp6"):
        lines = Path(f"/proc/{pid}/net/{table}").read_text(encoding="ascii").splitlines()[1:]
        # 0B00007F: the engine's own name server, in every container.
        listening = [line for line in lines if line.split()[3] == "0A" and " 0B00007F:" not in line]
        assert not listening


def test_limits_are_in_force_and_far_away(connected: Fleet) -> None:
    limits = connected.deployment.inspect("bridge")["HostConfig"]
    assert (limits["Memory"], limits["PidsLimit"], limits["CpuShares"]) == (256 << 20, 64, 256)
    assert limits["NanoCpus"] == 0.5e9
    rss_kib = int(status_fields(connected.deployment.program_pid("bridge"))["VmRSS"].split()[0])
    assert rss_kib < 128 << 10, "half of its limit"


def test_the_health_check_asks_the_bridge_by_its_socket(connected: Fleet) -> None:
    robot = connected.deployment

    def health() -> dict[str, Any]:
        found: dict[str, Any] = robot.inspect("bridge")["State"]["Health"]
        return found

    # The engine asks every 30 s.
    wait_until(lambda: health()["Status"] == "healthy", "the bridge is healthy", 2 * BACK_WITHIN_S)
    last = health()["Log"][-1]
    assert last["Output"].strip() == "/run/robot-bridge/bridge.sock: SERVING"
