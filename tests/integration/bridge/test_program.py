"""The whole program between a real gateway and a real hub."""

import asyncio
import json
import subprocess
import sys
from pathlib import Path

import pytest

from fleet.connection import Hub
from fleet.names import STATES
from omniseer.fleet.v1.state_pb2 import RobotState
from tests.support.eventually import eventually
from tests.support.nats_servers import NatsServers
from tests.support.running_bridge import ROBOT, bridge_program, received
from tests.support.running_gateway import running_gateway

ROOT = Path(__file__).parents[3]


async def state_of(hub: Hub) -> RobotState | None:
    entry = (await hub.entries(STATES)).get(ROBOT)
    return RobotState.FromString(entry.value) if entry else None


async def test_state_and_events_of_a_gateway_reach_the_hub(
    tmp_path: Path, hub: Hub, servers: NatsServers
) -> None:
    async with running_gateway(tmp_path / "preview.sock") as operator:
        with bridge_program(tmp_path / "bridge", operator.port, servers.urls) as bridge:
            await asyncio.to_thread(bridge.start)
            state = await eventually(
                lambda: state_of(hub), lambda found: found and found.gateway_reachable, "its state is there"
            )
            status = await operator.status()
            assert state
            assert (state.robot, state.gateway_run_id) == (ROBOT, status.gateway.run_id)
            assert state.gateway_name == status.gateway_name
            await operator.switch(True)
            found = await eventually(
                lambda: received(hub), lambda found: found.events, "what was done to it is there"
            )
            assert found.batches[-1].items[-1].event.run_id == status.gateway.run_id
    with bridge_program(tmp_path / "again", operator.port, servers.urls) as bridge:
        await asyncio.to_thread(bridge.start)
        await eventually(
            lambda: state_of(hub), lambda found: found and not found.gateway_reachable, "it says so"
        )
        assert await asyncio.to_thread(bridge.stop) == 0
        assert not bridge.socket.exists()


async def test_it_starts_and_serves_without_anyone_else(tmp_path: Path) -> None:
    with bridge_program(tmp_path / "bridge", 1, ("nats://127.0.0.1:1",)) as bridge:
        await asyncio.to_thread(bridge.start)
        status = await asyncio.to_thread(lambda: bridge.status)
        assert status.last_error
        assert await asyncio.to_thread(bridge.stop) == 0


def run(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-m", "bridge.cli", *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@pytest.mark.parametrize("server", ["tls://hub:4222", "nats://hub:4222"])
def test_a_hub_on_the_network_is_not_used_without_its_authority(tmp_path: Path, server: str) -> None:
    config = tmp_path / "bridge.yaml"
    config.write_text(json.dumps({"hub": {"servers": [server]}}), encoding="utf-8")
    ended = run("check", "--config", str(config))
    assert ended.returncode == 2
    assert "hub.ca is missing" in ended.stderr
    assert ended.stderr.count("\n") == 1


def test_the_doctor_says_what_is_wrong(tmp_path: Path) -> None:
    config = tmp_path / "bridge.yaml"
    values = {
        "socket": str(tmp_path / "none.sock"),
        "root": str(tmp_path),
        "gateway": {"target": "127.0.0.1:1"},
        "hub": {"ca": str(tmp_path / "none.pem")},
    }
    config.write_text(json.dumps(values), encoding="utf-8")
    ended = run("doctor", "--config", str(config), "--json")
    assert ended.returncode == 1, ended.stderr
    verdicts = {each["check"]: each["verdict"] for each in json.loads(ended.stdout)["findings"]}
    assert verdicts["hub.ca"] == verdicts["gateway"] == "wrong"
    assert verdicts["config"] == verdicts["commands"] == "good"
    assert verdicts["bridge"] == "note"


@pytest.mark.parametrize("words", [["hub", "--help"], ["enroll", "--help"]])
def test_the_hubs_administration_is_part_of_it(words: list[str]) -> None:
    ended = run(*words)
    assert ended.returncode == 0 or "robot-gateway[hub]" in ended.stderr
