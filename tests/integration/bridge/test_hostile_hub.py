"""What a client that may publish into a robot's commands can do to its bridge: a real server passes it on."""

import asyncio
from pathlib import Path

import psutil
import pytest

from fleet import names
from fleet.connection import Hub
from omniseer.bridge.v1 import bridge_service_pb2 as pb
from omniseer.fleet.v1 import command_pb2
from tests.integration.bridge.test_commands import requests
from tests.support.event_server import EventServer
from tests.support.eventually import eventually
from tests.support.nats_servers import NatsServers
from tests.support.running_bridge import ROBOT, BridgeProgram, bridge_program, received

ALLOWED = {"commands": {"allowed": ["snapshot"]}}


async def publish_raw(servers: NatsServers, *messages: bytes) -> None:
    """Publishes as no library does, and returns when the server has taken it."""
    reader, writer = await asyncio.open_connection("127.0.0.1", servers.ports[0])
    try:
        writer.write(b'CONNECT {"verbose":false,"pedantic":false,"headers":true}\r\n')
        writer.write(b"".join(messages) + b"PING\r\n")
        async with asyncio.timeout(10):
            while (line := await reader.readline()) != b"PONG\r\n":
                assert not line.startswith(b"-ERR"), line
    finally:
        writer.close()
        await writer.wait_closed()


def message(subject: bytes, headers: bytes, payload: bytes) -> bytes:
    sizes = b"%d %d" % (len(headers), len(headers) + len(payload))
    return b"HPUB %s %s\r\n%s%s\r\n" % (subject, sizes, headers, payload)


def command(command_id: str) -> tuple[bytes, bytes]:
    """Returns the subject and the payload of one that is as it should be."""
    made = command_pb2.Command(command_id=command_id, robot=ROBOT, issued_by="anna", expires_after_s=60)
    made.snapshot.label = "door"
    return names.command_subject(ROBOT, command_id).encode(), made.SerializeToString()


async def state_of(bridge: BridgeProgram) -> pb.WatchStateResponse:
    return await asyncio.to_thread(lambda: bridge.state)


async def waiting(hub: Hub) -> int:
    """Returns how many commands are not acknowledged."""
    info = await hub.api(f"CONSUMER.INFO.{names.COMMANDS}.{ROBOT}")
    return int(info["num_pending"]) + int(info["num_ack_pending"])


@pytest.mark.usefixtures("hub")
async def test_headers_and_subjects_without_sense_keep_no_command_back(
    tmp_path: Path, gateway: EventServer, servers: NatsServers
) -> None:
    """The stream, which takes 64 KiB of headers, delivers them again after every new connection."""
    (first, payload), (second, other) = command("f1"), command("f2")
    beginning = f"fleet.{ROBOT}.cmd.".encode()
    await publish_raw(
        servers,
        message(beginning + b"\xff", b"NATS/1.0 \xff\xff\xff\r\n\r\n", b"x"),
        message(beginning + b"y" * 4000, b"NATS/1.0\r\n\r\n", b"x"),
        message(first, b"NATS/1.0 409 Consumer Deleted\r\n\r\n", payload),
        message(second, b"NATS/1.0\r\n" + b"a: b\r\n" * 10_000 + b"\r\n", other),
    )
    with bridge_program(tmp_path / "bridge", gateway.port, servers.urls, **ALLOWED) as bridge:
        await asyncio.to_thread(bridge.start)
        found = await eventually(lambda: requests(bridge), lambda found: len(found) == 2, "both are there")
        state = await state_of(bridge)
    assert [each.request_id for each in found] == ["f1", "f2"]
    assert state.not_taken.strays == 2
    # Two subjects and the headers of f2; the newest servers take a status off that a client has sent.
    assert state.not_taken.unreadable >= 3
    assert state.not_taken.denied == 0


async def test_a_flood_of_commands_costs_neither_memory_nor_events(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers
) -> None:
    """What exceeds the rate waits at the hub; the gateway is not asked for more than four."""
    with bridge_program(tmp_path / "bridge", gateway.port, servers.urls, **ALLOWED) as bridge:
        await asyncio.to_thread(bridge.start)
        gateway.happen(1)
        await eventually(lambda: received(hub), lambda found: found.batches, "it is connected")
        assert bridge.process is not None
        process = psutil.Process(bridge.process.pid)
        before = process.memory_info().rss
        flood = (
            b"PUB %s %d\r\n%s\r\n" % (subject, len(payload), payload)
            for subject, payload in (command(f"g{number}") for number in range(1000))
        )
        await publish_raw(servers, *flood)
        await eventually(lambda: requests(bridge), lambda found: len(found) == 4, "four are handed over")
        sent = (await state_of(bridge)).status.events_sent
        gateway.happen(100)
        await eventually(
            lambda: state_of(bridge), lambda state: state.status.events_sent >= sent + 100, "events go on"
        )
        grown = process.memory_info().rss - before
        await eventually(lambda: waiting(hub), lambda count: count == 1000, "the others wait at the hub")
    assert grown < 16 * 1024 * 1024
