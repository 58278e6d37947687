"""What operators see of the fleet: status, health, faults, events; and what a dead or frozen bridge costs."""

import asyncio
import os
import signal
import time
from pathlib import Path
from typing import Any

import pytest

from omniseer.gateway.v1 import cloud_pb2, recording_pb2
from tests.support.bridge_double import BridgeDouble, bridge_process, serving_bridge
from tests.support.eventually import eventually
from tests.support.fleet_robot import FleetRobot, fleet_robot
from tests.support.recorder_double import RecorderDouble
from tests.support.running_gateway import running_gateway

QUICK = {"startup_grace_ms": 0, "clear_after_ms": 0, "hub_offline_s": 0}
CONNECTED, UNREACHABLE = cloud_pb2.CLOUD_STATE_CONNECTED, cloud_pb2.CLOUD_STATE_UNREACHABLE


async def test_a_robot_without_a_bridge_has_no_cloud(tmp_path: Path) -> None:
    async with running_gateway(tmp_path / "preview.sock") as operator:
        assert not (await operator.status()).HasField("cloud")


async def test_what_the_bridge_reports_is_in_the_status_and_becomes_faults_and_events(
    tmp_path: Path,
) -> None:
    async with fleet_robot(tmp_path, faults=QUICK) as robot:
        double = robot.bridge

        async def faults() -> dict[str, Any]:
            found = (await robot.operator.status()).faults
            return {each.id: each for each in found if each.active and each.component == "fleet"}

        cloud = (await robot.operator.status()).cloud
        assert (cloud.state, cloud.robot, cloud.fleet) == (CONNECTED, "lab-1", "lab")
        double.report.status.events_dropped = 1
        double.copies("a").state = recording_pb2.RECORDING_COPY_STATE_FAILED
        double.becomes(cloud_pb2.CLOUD_STATE_REFUSED, "it was revoked")
        found = await eventually(faults, lambda now: len(now) >= 3, "faults of the fleet")
        assert set(found) == {"cloud.refused", "cloud.outbox", "cloud.upload"}
        health = (await robot.operator.status()).health
        assert (health.ready, health.summary) == (True, "robot healthy")
        copied = (await robot.event("recording_copy_changed")).recording_copy_changed
        assert copied.recording_id == "a"
        double.becomes(cloud_pb2.CLOUD_STATE_OFFLINE, "no route")
        await eventually(faults, lambda now: "cloud.offline" in now, "the hub is away")
        assert not robot.recorder.faults, "what happens at the hub makes no incident"


@pytest.mark.timed
async def test_a_state_is_an_event_after_five_seconds(tmp_path: Path) -> None:
    async with fleet_robot(tmp_path) as robot:
        # The first settled state is the baseline.
        await asyncio.sleep(5.5)
        began_s = time.monotonic()
        robot.bridge.becomes(cloud_pb2.CLOUD_STATE_OFFLINE, "no route")
        event = await robot.event("cloud_state_changed")
        assert 4.5 <= time.monotonic() - began_s <= 7
        assert event.cloud_state_changed.state == cloud_pb2.CLOUD_STATE_OFFLINE
        assert event.cloud_state_changed.last_error == "no route"


async def answer_times_s(robot: FleetRobot, count: int) -> list[float]:
    """How long statuses take, sorted."""
    times = []
    for _ in range(count):
        began_s = time.perf_counter()
        await robot.operator.status()
        times.append(time.perf_counter() - began_s)
    return sorted(times)


@pytest.mark.timed
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "frozen"])
async def test_a_bridge_that_dies_or_freezes_is_unreachable_within_2_5_s_and_costs_nothing(
    tmp_path: Path, how: signal.Signals
) -> None:
    socket = tmp_path / "bridge.sock"
    async with running_gateway(tmp_path / "preview.sock", bridge={"socket": socket}) as operator:
        robot = FleetRobot(operator, BridgeDouble(), RecorderDouble())
        with bridge_process(socket) as process:
            await robot.reaches(CONNECTED)
            before = await answer_times_s(robot, 300)
            os.kill(process.pid, how)
            began_s = time.monotonic()
            during = await answer_times_s(robot, 300)
            await eventually(robot.cloud_state, lambda now: now == UNREACHABLE, "it is noticed", 5)
            # A report may have come just before: the silence is 2.5 s, the look at the status takes a moment.
            assert time.monotonic() - began_s < 2.5 + 0.3
            during += await answer_times_s(robot, 300)
            assert sorted(during)[int(0.99 * len(during))] < 3 * before[int(0.99 * len(before))] + 0.005
            assert (await operator.status()).health.ready
        async with serving_bridge(socket, robot.bridge):
            await robot.reaches(CONNECTED)
