"""Requests of a real hub on their way to the gateway, whose part a test plays over the bridge's socket."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import grpc
import pytest

from fleet import names
from fleet.connection import Hub, Start
from omniseer.bridge.v1 import bridge_service_pb2 as pb
from omniseer.bridge.v1.bridge_service_pb2_grpc import BridgeServiceStub
from omniseer.fleet.v1 import command_pb2
from omniseer.gateway.v1 import cloud_pb2
from tests.support.event_server import EventServer
from tests.support.eventually import eventually
from tests.support.nats_servers import NatsServers
from tests.support.running_bridge import ROBOT, BridgeProgram, bridge_program, received

DONE, REFUSED = command_pb2.COMMAND_OUTCOME_DONE, command_pb2.COMMAND_OUTCOME_REFUSED
EXPIRED, FAILED = command_pb2.COMMAND_OUTCOME_EXPIRED, command_pb2.COMMAND_OUTCOME_FAILED


async def issue(hub: Hub, command_id: str, *, subject: str = "", payload: bytes = b"", **fields: Any) -> None:
    command = command_pb2.Command(command_id=command_id, robot=ROBOT, issued_by="anna", expires_after_s=30)
    command.snapshot.label = "door"
    for key, value in fields.items():
        setattr(command, key, value)
    subject = subject or names.command_subject(ROBOT, command_id)
    await hub.publish_once(subject, payload or command.SerializeToString())


async def results(hub: Hub) -> dict[str, command_pb2.CommandResult]:
    info = await hub.api(f"STREAM.INFO.{names.RESULTS}")
    found: dict[str, command_pb2.CommandResult] = {}
    if not info["state"]["messages"]:
        return found
    async for delivery in hub.follow(names.RESULTS, f"fleet.{ROBOT}.res.*", Start.all()):
        result = command_pb2.CommandResult.FromString(delivery.payload)
        assert delivery.subject == names.result_subject(ROBOT, result.command_id)
        assert result.command_id not in found, "one result for each"
        found[result.command_id] = result
        if delivery.pending == 0:
            break
    return found


async def acknowledged(hub: Hub) -> bool:
    info = await hub.api(f"CONSUMER.INFO.{names.COMMANDS}.{ROBOT}")
    return bool(info["num_pending"] == info["num_ack_pending"] == 0)


@asynccontextmanager
async def calls(bridge: BridgeProgram) -> AsyncIterator[Any]:
    async with grpc.aio.insecure_channel(f"unix:{bridge.socket}") as channel:
        yield BridgeServiceStub(channel)


async def requests(bridge: BridgeProgram) -> list[pb.HubRequest]:
    return list((await asyncio.to_thread(lambda: bridge.state)).requests)


async def test_a_request_is_answered_once_and_then_forgotten(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers
) -> None:
    allowed = {"commands": {"allowed": ["snapshot"]}}
    with bridge_program(tmp_path / "bridge", gateway.port, servers.urls, **allowed) as bridge:
        await asyncio.to_thread(bridge.start)
        await issue(hub, "a1")
        (request,) = await eventually(lambda: requests(bridge), lambda found: found, "it is handed over")
        assert (request.request_id, request.issued_by, request.snapshot.label) == ("a1", "anna", "door")
        assert 20_000 < request.remaining_ms <= 30_000
        async with calls(bridge) as stub:
            answer = pb.AnswerRequestRequest(
                request_id="a1", outcome=pb.REQUEST_OUTCOME_DONE, message="made", recording_id="r1"
            )
            await stub.AnswerRequest(answer)
            with pytest.raises(grpc.aio.AioRpcError) as error:
                await stub.AnswerRequest(answer)
            assert error.value.code() is grpc.StatusCode.NOT_FOUND
        found = await eventually(lambda: results(hub), lambda found: found, "the hub has the result")
        await eventually(lambda: acknowledged(hub), bool, "it is acknowledged")
    result = found["a1"]
    assert (result.robot, result.outcome, result.message, result.recording_id) == (ROBOT, DONE, "made", "r1")


async def test_a_hostile_hub_reaches_nothing_but_refusals(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers
) -> None:
    allowed = {"commands": {"allowed": ["snapshot"]}}
    with bridge_program(tmp_path / "bridge", gateway.port, servers.urls, **allowed) as bridge:
        await asyncio.to_thread(bridge.start)
        await issue(hub, "b1", robot="lab3")
        await issue(hub, "b2", payload=b"\xff" * 3000)
        await issue(hub, "b3", payload=b"x" * 300_000)
        await issue(hub, "b-4")
        found = await eventually(lambda: results(hub), lambda found: len(found) == 3, "all are answered")
        await eventually(lambda: acknowledged(hub), bool, "all are acknowledged")
        assert not await requests(bridge)
    assert {each.outcome for each in found.values()} == {REFUSED}


async def test_a_command_that_waited_for_too_long_is_not_carried_out(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers
) -> None:
    allowed = {"commands": {"allowed": ["snapshot"]}}
    await issue(hub, "c1", expires_after_s=1)
    await asyncio.sleep(1)
    with bridge_program(tmp_path / "bridge", gateway.port, servers.urls, **allowed) as bridge:
        await asyncio.to_thread(bridge.start)
        await issue(hub, "c2", expires_after_s=2)
        found = await eventually(lambda: results(hub), lambda found: len(found) == 2, "both are answered")
    assert {each.outcome for each in found.values()} == {EXPIRED}


async def test_killed_before_the_answer_it_does_not_hand_the_request_over_again(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers
) -> None:
    allowed = {"commands": {"allowed": ["snapshot"]}}
    with bridge_program(tmp_path / "bridge", gateway.port, servers.urls, **allowed) as bridge:
        await asyncio.to_thread(bridge.start)
        await issue(hub, "d1")
        await eventually(lambda: requests(bridge), lambda found: found, "it is handed over")
        bridge.kill()
        await asyncio.to_thread(bridge.start)
        found = await eventually(lambda: results(hub), lambda found: found, "the hub has a result")
        assert not await requests(bridge)
    assert found["d1"].outcome == FAILED
    assert "restarted" in found["d1"].message


async def test_without_a_word_in_the_configuration_nothing_is_taken(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers
) -> None:
    with bridge_program(tmp_path / "bridge", gateway.port, servers.urls) as bridge:
        await asyncio.to_thread(bridge.start)
        await issue(hub, "e1")
        await eventually(
            lambda: asyncio.to_thread(lambda: bridge.status),
            lambda status: status.state == cloud_pb2.CLOUD_STATE_CONNECTED,
            "it is connected",
        )
        await eventually(lambda: received(hub), lambda found: found.batches, "it has sent what it missed")
        assert not await requests(bridge)
        info = await hub.api(f"CONSUMER.INFO.{names.COMMANDS}.{ROBOT}")
    assert info["num_pending"] == 1
    assert info["num_waiting"] == 0
