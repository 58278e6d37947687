"""A hub, or a bridge, that sends anything: the gateway does what is allowed at its rate, and nothing else."""

import operator
import random
import time
from functools import partial
from pathlib import Path
from typing import Any

import grpc
import psutil
import pytest

from gateway.links.bridge.requests import BURST
from omniseer.bridge.v1 import bridge_service_pb2 as bridge_pb
from omniseer.gateway.v1 import cloud_pb2, recording_pb2
from tests.support.bridge_double import BridgeDouble, serving_bridge
from tests.support.eventually import eventually
from tests.support.fleet_robot import BOTH, FleetRobot, fleet_robot
from tests.support.recorder_double import RecorderDouble
from tests.support.running_gateway import running_gateway

_MOST_GROWTH_BYTES = 40 * 1024 * 1024
REQUESTS = 400
"""The unit tests have more; here each crosses a socket."""


class HostileHub(BridgeDouble):
    """Has four other requests each time that it is answered, until there were REQUESTS."""

    def __init__(self) -> None:
        super().__init__()
        self.random = random.Random(17)
        self.issued = 0
        self.flood = True

    async def AnswerRequest(self, request: Any, context: Any) -> Any:  # noqa: N802  # grpc's name
        answer = await super().AnswerRequest(request, context)
        self.answers = self.answers[-1:]
        return answer

    async def WatchState(self, request: Any, context: Any) -> Any:  # noqa: N802
        async for report in super().WatchState(request, context):
            del report.requests[:]
            for _ in range(4):
                if self.issued < REQUESTS:
                    self._issue()
            yield report

    def _issue(self) -> None:
        self.issued += 1
        choose = self.random.choice
        junk = choose(["", "\n", "x" * 10_000, "\u202e\x1b[2J", "StopRobot", "DeleteRecording", "../../etc"])
        request = self.report.requests.add(
            request_id=choose([f"id-{self.issued}", "same", junk]),
            issued_by=f"{junk}{self.issued}",
            remaining_ms=choose([0, 1, 60_000, 2**64 - 1]),
        )
        match self.random.randrange(4):
            case 0:
                request.upload.recording_id = junk
            case 1:
                request.snapshot.label = junk
                request.snapshot.pre_s = self.random.randrange(2**32)
            case 2:
                request.MergeFromString(b"\x32\x04\x0a\x02hi")  # field 6: an action of a later schema
            case _:
                request.snapshot.label = "fine"


@pytest.mark.timed
async def test_a_hostile_hub_makes_the_gateway_do_nothing_else(tmp_path: Path) -> None:
    hub = HostileHub()
    audit = tmp_path / "audit.jsonl"
    security = {"audit": {"file": audit}}
    async with fleet_robot(tmp_path, allowed=BOTH, bridge=hub, security=security) as robot:
        before_bytes = psutil.Process().memory_info().rss
        began_s = time.monotonic()

        async def issued() -> int:
            return hub.issued

        slowest_s = 0.0
        for share in (0.2, 0.5, 1.0):
            await eventually(issued, partial(operator.le, REQUESTS * share), "requests come", 30)
            asked_s = time.monotonic()
            await robot.operator.status()
            slowest_s = max(slowest_s, time.monotonic() - asked_s)
        lasted_s = time.monotonic() - began_s
        most = BURST + 1 + lasted_s / 10
        requests = [request for request, _ in robot.recorder.requests]
        assert {type(each).__name__ for each in requests} <= {"TriggerSnapshotRequest"}
        assert {method for method, _, _ in hub.calls} <= {"upload"}
        assert 0 < len(requests) + len(hub.calls) <= most
        assert slowest_s < 1.0
        status = await robot.operator.status()
        assert status.cloud.state == cloud_pb2.CLOUD_STATE_CONNECTED
        assert psutil.Process().memory_info().rss - before_bytes < _MOST_GROWTH_BYTES
    assert len(audit.read_text(encoding="utf-8").splitlines()) < 60, "repeated ones are folded"


class HostileBridge(BridgeDouble):
    """Reports bytes that are no report, or one with unknown numbers, or far too long ones."""

    def __init__(self) -> None:
        super().__init__()
        self.random = random.Random(23)
        self.connections = 0

    async def WatchState(self, _request: Any, _context: Any) -> Any:  # noqa: N802
        self.connections += 1
        for _ in range(5):
            yield self._report()

    def _report(self) -> bridge_pb.WatchStateResponse:
        report = bridge_pb.WatchStateResponse()
        match self.random.randrange(4):
            case 0:
                anything: Any = self.random.randrange(-(2**31), 2**31)
                report.status.state = anything
            case 1:
                report.CopyFrom(self.report)
                report.status.last_error = "x" * 300_000
            case 2:
                report.CopyFrom(self.report)
                for number in range(20_000):
                    failed = recording_pb2.RECORDING_COPY_STATE_FAILED
                    report.copies.add(recording_id=str(number)).copy.state = failed
            case _:
                report.CopyFrom(self.report)
                report.status.outbox_bytes = report.status.state_age_ms = 2**64 - 1
                report.instance_id = "x" * 10_000
        return report


async def test_a_bridge_that_reports_anything_leaves_the_status_alive(tmp_path: Path) -> None:
    bridge, socket = HostileBridge(), tmp_path / "bridge.sock"
    async with (
        serving_bridge(socket, bridge),
        running_gateway(tmp_path / "preview.sock", bridge={"socket": socket}) as caller,
    ):
        robot = FleetRobot(caller, bridge, RecorderDouble())

        async def connections() -> int:
            status = await robot.operator.status()
            assert len(status.SerializeToString()) < 100_000
            return bridge.connections

        await eventually(connections, lambda now: now >= 8, "it is tried again and again", 30)
        assert not bridge.calls


async def test_bytes_that_are_no_message_break_the_connection_alone(tmp_path: Path) -> None:
    socket = tmp_path / "bridge.sock"

    async def junk(_request: Any, _context: Any) -> Any:
        yield random.Random(5).randbytes(1000)

    handlers: dict[str, Any] = {"WatchState": grpc.unary_stream_rpc_method_handler(junk)}
    server = grpc.aio.server()
    server.add_generic_rpc_handlers(
        (grpc.method_handlers_generic_handler("omniseer.bridge.v1.BridgeService", handlers),)
    )
    server.add_insecure_port(f"unix:{socket}")
    await server.start()
    async with running_gateway(tmp_path / "preview.sock", bridge={"socket": socket}) as caller:
        robot = FleetRobot(caller, BridgeDouble(), RecorderDouble())
        await robot.reaches(cloud_pb2.CLOUD_STATE_UNREACHABLE)

        async def why() -> str:
            return str((await caller.status()).cloud.last_error)

        assert await eventually(why, lambda now: now != "not connected yet", "it was tried")
    await server.stop(0)
