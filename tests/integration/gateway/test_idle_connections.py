"""Connections that only take room: few of them are kept, and not for long; operators do not notice them."""

import asyncio
import functools
import os
import resource
import socket
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import AsyncExitStack, ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import grpc
import pytest
from grpc_health.v1.health_pb2 import HealthCheckRequest, HealthCheckResponse
from grpc_health.v1.health_pb2_grpc import HealthStub

from bench.siege.crowd import Crowd
from common.addresses import bracketed
from common.bind import bind_tcp
from common.healthcheck import state_of
from common.reasons import Reason
from common.rpc import new_server
from common.tasks import cancel
from console.client import NotAllowed
from gateway.access.role import Role
from gateway.assembly import ThisRobot, build
from gateway.config import GatewaySettings
from gateway.rpc.calls.call import peer_of
from gateway.rpc.connections.accepted_sockets import UNLIMITED, AcceptedSockets
from gateway.rpc.connections.admission import MAX_PENDING
from omniseer.gateway.v1.robot_gateway_pb2 import GetSystemStatusRequest, WatchSystemStatusRequest
from omniseer.gateway.v1.robot_gateway_pb2_grpc import RobotGatewayStub
from tests.support.detour import detour
from tests.support.eventually import eventually
from tests.support.free import free_tcp_port
from tests.support.guarded_gateway import guarded_gateway, new_robot
from tests.support.guarded_program import guarded_program
from tests.support.running_gateway import raw_unary, running_gateway
from tests.support.waiting import wait_until

SETTLED_WITHIN_S = 4.5
"""Sooner than gRPC itself gives up a handshake."""
COMES_THROUGH_WITHIN_S = 60.0
"""Three attempts of gRPC to connect, each with five of TCP; 3 s after the last stranger none is dropped."""
ANSWERED_WITHIN_S = 60.0
"""Of health checks, which allow 3 s each, by a gateway that stands still whenever this process does."""
NOTHING = b""
HTTP2 = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes([0, 0, 0, 4, 0, 0, 0, 0, 0])
"""The connection preface and empty settings (RFC 9113 3.4): more is not needed to be a connection."""
HALF_A_CLIENT_HELLO = bytes([22, 3, 1, 2, 0, 1, 0])


@contextmanager
def connections(
    port: int, count: int, said: bytes = NOTHING, hosts: Sequence[str] = ("127.0.0.1",)
) -> Iterator[list[socket.socket]]:
    """TCP connections, `count` from each of `hosts`, that say one thing and then nothing."""
    with ExitStack() as stack:
        opened = []
        for number in range(count * len(hosts)):
            source = (hosts[number % len(hosts)], 0)
            each = stack.enter_context(socket.create_connection(("127.0.0.1", port), source_address=source))
            each.sendall(said)
            each.setblocking(False)
            opened.append(each)
        yield opened


def alive(opened: list[socket.socket]) -> list[socket.socket]:
    """Those that the other side has not closed; what it sent is read away."""
    found = []
    for each in opened:
        try:
            while each.recv(4096):
                pass
        except BlockingIOError:
            found.append(each)
        except ConnectionError:
            pass
    return found


async def until_at_most(opened: list[socket.socket], count: int) -> None:
    deadline_s = time.monotonic() + SETTLED_WITHIN_S
    while len(alive(opened)) > count:
        assert time.monotonic() < deadline_s, f"{len(alive(opened))} are still open"
        await asyncio.sleep(0.05)


@pytest.mark.parametrize("said", [NOTHING, HTTP2], ids=["nothing", "http2"])
async def test_idle_connections_of_one_address_leave_room(tmp_path: Path, said: bytes) -> None:
    async with running_gateway(tmp_path / "p.sock") as operator:
        await operator.status()
        with connections(operator.port, 500, said) as opened:
            await until_at_most(opened, MAX_PENDING // 2)
            assert (await operator.status()).gateway_name
            with connections(operator.port, 1, said) as (newest,):
                await asyncio.sleep(0.5)
                assert alive([newest]), "a newcomer has its chance"


async def test_a_connection_without_a_call_is_closed_after_a_while(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gateway.rpc.connections.admission.PENDING_S", 1.0)
    async with running_gateway(tmp_path / "p.sock") as operator:
        await operator.status()
        watching = operator.stub.WatchSystemStatus(WatchSystemStatusRequest())
        opened_s = time.monotonic()
        with connections(operator.port, 3, HTTP2) as opened:
            await until_at_most(opened, 2)
            assert time.monotonic() - opened_s >= 1.0
            await until_at_most(opened, 0)
        for _ in range(10):
            assert await watching.read() is not grpc.aio.EOF, "one with calls stays"
        watching.cancel()


@pytest.mark.parametrize("said", [NOTHING, HALF_A_CLIENT_HELLO], ids=["nothing", "half a hello"])
async def test_strangers_from_many_addresses_keep_no_operator_out(tmp_path: Path, said: bytes) -> None:
    """Here with a handshake that none of them finishes, and of an address that the gateway always trusts."""
    robot = new_robot(tmp_path)
    _, login = robot.add(Role.VIEWER)
    strangers = [f"127.0.1.{number}" for number in range(1, 31)]
    async with guarded_gateway(robot):
        with connections(robot.port, 10, said, strangers) as opened:
            for _ in range(5):
                stub = RobotGatewayStub(robot.channel())
                status: Any = await stub.GetSystemStatus(
                    GetSystemStatusRequest(), metadata=login.metadata(), timeout=5, wait_for_ready=True
                )
                assert status.gateway_name
            await until_at_most(opened, MAX_PENDING)


@pytest.mark.timeout(360)  # five logins of a minute at the most
async def test_an_address_never_heard_of_gets_in_while_strangers_keep_coming_back(tmp_path: Path) -> None:
    """Attempts to connect from there are dropped by chance; TCP repeats them, each time with better odds."""
    robot = new_robot(tmp_path)
    _, login = robot.add(Role.VIEWER)
    async with guarded_gateway(robot), AsyncExitStack() as stack:
        crowd = Crowd(("127.0.0.1", robot.port))
        strangers = [
            asyncio.create_task(crowd.drip(f"127.0.2.{number}")) for number in range(1, 31) for _ in range(10)
        ]
        stack.push_async_callback(cancel, strangers)
        await eventually(tried_by(crowd), lambda tried: tried > len(strangers), "the gateway cuts some off")
        for number in range(1, 6):
            way = await stack.enter_async_context(detour(f"127.5.0.{number}", robot.port))
            stub = RobotGatewayStub(replace(robot, port=way).channel())
            status: Any = await stub.GetSystemStatus(
                GetSystemStatusRequest(),
                metadata=login.metadata(),
                timeout=COMES_THROUGH_WITHIN_S,
                wait_for_ready=True,
            )
            assert status.gateway_name
        assert not any(each.done() for each in strangers), "they are still at it"


def tried_by(crowd: Crowd) -> Callable[[], Awaitable[int]]:
    async def tried() -> int:
        return crowd.counts.tried

    return tried


async def test_watching_strangers_take_no_place_of_an_operator_and_leave_soon(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gateway.rpc.connections.admission.PENDING_S", 3.0)
    robot = new_robot(tmp_path / "robot")
    _, login = robot.add(Role.VIEWER)
    unix = tmp_path / "gateway.sock"
    async with guarded_gateway(
        robot, grpc={"socket": unix}, limits={"connections": 4, "connections_per_address": 4}
    ):
        watches = []
        for _ in range(4):
            stub: Any = HealthStub(robot.channel())  # its type has no methods
            watches.append(stub.Watch(HealthCheckRequest()))
            assert (await watches[-1].read()).status == HealthCheckResponse.SERVING
        operators = [RobotGatewayStub(robot.channel()) for _ in range(4)]
        streams = [
            each.WatchSystemStatus(WatchSystemStatusRequest(), metadata=login.metadata())
            for each in operators
        ]
        for stream in streams:
            assert await stream.read() is not grpc.aio.EOF
        assert await asyncio.to_thread(answered, lambda: state_of(f"unix:{unix}")) == "SERVING"
        for watch in watches:
            with pytest.raises(grpc.aio.AioRpcError) as seen:
                await asyncio.wait_for(watch.read(), 10)
            assert seen.value.code() is grpc.StatusCode.UNAVAILABLE
        for stream in streams:
            assert await stream.read() is not grpc.aio.EOF
            stream.cancel()


async def test_callers_that_take_every_place_without_a_credential_keep_out_no_check_over_the_unix_socket(
    tmp_path: Path,
) -> None:
    """Where none is needed: `security.insecure`, or the loopback."""
    port, unix = free_tcp_port(), tmp_path / "gateway.sock"
    grpc_settings = {"port": port, "socket": unix}
    async with running_gateway(
        tmp_path / "p.sock", port=port, grpc=grpc_settings, limits={"connections": 1}
    ) as operator:
        stub: Any = HealthStub(operator.channel)  # its type has no methods
        watch = stub.Watch(HealthCheckRequest())
        assert (await watch.read()).status == HealthCheckResponse.SERVING
        # In a process of its own, as the container's: in this one it would share the watcher's connection.
        by_tcp, by_socket = [
            await asyncio.to_thread(answered, functools.partial(health_said, target))
            for target in (f"127.0.0.1:{port}", f"unix:{unix}")
        ]
        assert by_tcp.startswith("RESOURCE_EXHAUSTED")
        assert by_socket == "SERVING"
        watch.cancel()


def health_said(target: str) -> str:
    """The state that a container's health check prints."""
    command = [sys.executable, "-m", "common.healthcheck", target]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    return done.stdout.strip().removeprefix(f"{target}: ")


def answered(ask: Callable[[], str]) -> str:
    """Asks for a state until the gateway, which may stand still with this process, has given one in time."""
    late = grpc.StatusCode.DEADLINE_EXCEEDED.name

    def state() -> str | None:
        found = ask()
        return None if found.startswith(late) else found

    return wait_until(state, "the health check is answered", ANSWERED_WITHIN_S)


def test_connections_do_not_take_the_descriptors_that_a_revocation_needs(tmp_path: Path) -> None:
    with guarded_program(tmp_path, tmp_path / "home", descriptors=256) as robot:
        port = int(robot.target.rpartition(":")[2])
        with robot.client() as client, connections(port, 300) as opened:
            wait_until(lambda: len(alive(opened)) <= 16, "half of a quarter of half of them are left")
            stream = client.watch_status()
            next(stream)
            with robot.client() as another:
                assert another.status().gateway_name
            robot.admin.revoke("the-test")
            with pytest.raises(NotAllowed) as seen:
                for _ in stream:
                    pass
            assert seen.value.reason == Reason.CREDENTIAL_REVOKED


@pytest.mark.parametrize(("by_socket", "each"), [(False, 200), (True, 100)])
def test_all_addresses_together_get_half_of_the_descriptors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, by_socket: bool, each: int
) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _which: (400, 400))
    served = {"socket": tmp_path / "gateway.sock"} if by_socket else {}
    settings = GatewaySettings.model_validate({"grpc": served, "sources": ()})
    assert build(settings, ThisRobot(settings)).max_connections == each


def test_only_connections_of_the_port_are_found_and_closed() -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as ours,
        socket.create_server(("127.0.0.1", 0)) as other,
        socket.create_connection(ours.getsockname()) as client,
        socket.create_connection(other.getsockname()) as bystander,
    ):
        accepted, _ = ours.accept()
        untouched, _ = other.accept()
        with accepted, untouched:
            sockets = AcceptedSockets(ours.getsockname()[1])
            address = f"127.0.0.1:{client.getsockname()[1]}"
            assert sockets.scan() == [address]
            assert sockets.close(address)
            assert not sockets.close(address)
            assert client.recv(1) == b""
            bystander.sendall(b"x")
            assert untouched.recv(1) == b"x"


def test_a_throttled_peer_is_answered_slowly_until_it_is_released() -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as server,
        socket.create_connection(server.getsockname(), timeout=10) as peer,
    ):
        accepted, _ = server.accept()
        with accepted:
            sockets = AcceptedSockets(server.getsockname()[1])
            (address,) = sockets.scan()
            sockets.throttle(address, 1000)
            for _ in range(10):  # the kernel does not pace these
                accepted.sendall(b"x" * 1000)
                peer.recv(4000)
            began_s = time.monotonic()
            accepted.sendall(b"x" * 1000)
            accepted.sendall(b"x" * 1000)
            accepted.sendall(b"x" * 1000)
            missing = 3000
            while missing:
                more = peer.recv(4000)
                assert more, "it was closed"
                missing -= len(more)
            assert time.monotonic() - began_s > 0.9, "a second for each but the first"
            sockets.throttle(address, UNLIMITED)
            began_s = time.monotonic()
            for _ in range(10):
                accepted.sendall(b"x" * 1000)
                assert peer.recv(4000)
            assert time.monotonic() - began_s < 5, "ten seconds at the old rate"


def test_a_muted_peer_is_not_heard_any_more() -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as server,
        socket.create_connection(server.getsockname()) as muted,
        socket.create_connection(server.getsockname()) as other,
    ):
        from_muted, _ = server.accept()
        from_other, _ = server.accept()
        with from_muted, from_other:
            sockets = AcceptedSockets(server.getsockname()[1])
            sockets.scan()
            address = f"127.0.0.1:{muted.getsockname()[1]}"
            muted.sendall(b"heard")
            assert from_muted.recv(16) == b"heard"
            assert sockets.received_bytes(address) == len(b"heard")
            assert sockets.mute(address)
            muted.sendall(b"not heard")
            other.sendall(b"heard")
            assert from_other.recv(16) == b"heard"
            from_muted.setblocking(False)
            with pytest.raises(BlockingIOError):
                from_muted.recv(16)
            assert sockets.received_bytes(address) == len(b"heard")
    assert sockets.received_bytes("127.0.0.1:1") == 0
    assert not sockets.mute("127.0.0.1:1")


def test_a_descriptor_that_was_used_again_is_left_alone() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        gone = socket.create_connection(("127.0.0.1", port))
        reused, _ = server.accept()
        sockets = AcceptedSockets(port)
        (address,) = sockets.scan()
        with socket.create_connection(("127.0.0.1", port)) as next_one, reused:
            accepted, _ = server.accept()
            with accepted:
                # Closes the connection; in the same moment the next one has its number.
                os.dup2(accepted.fileno(), reused.fileno(), inheritable=False)
            gone.close()
            assert not sockets.close(address)
            reused.sendall(b"x")
            assert next_one.recv(1) == b"x"


def local_addresses() -> list[str]:
    """Of this machine; link-local ones with their interface, but none that a container or a test makes."""
    lines = Path("/proc/net/if_inet6").read_text(encoding="ascii").splitlines()
    found = ["127.0.0.1"]
    for line in lines:
        digits, _, _, _, _, interface = line.split()
        if interface.startswith(("veth", "br-", "lossy")):
            continue
        address = socket.inet_ntop(socket.AF_INET6, bytes.fromhex(digits))
        found.append(f"{address}%{interface}" if address.startswith("fe80:") else address)
    return found


@pytest.mark.parametrize("address", local_addresses())
async def test_a_connection_has_the_same_address_in_the_account_of_calls(address: str) -> None:
    """GRPC's spelling of it is what calls are known by."""
    callers = []

    async def note_caller(_request: bytes, context: Any) -> bytes:
        callers.append(peer_of(context.peer()).address)
        return b""

    server = new_server()
    handler: dict[str, grpc.RpcMethodHandler[bytes, bytes]] = {
        "Note": grpc.unary_unary_rpc_method_handler(note_caller)
    }
    server.add_generic_rpc_handlers((grpc.method_handlers_generic_handler("test.Service", handler),))
    port = bind_tcp(server, "::", 0)
    await server.start()
    try:
        async with grpc.aio.insecure_channel(f"{bracketed(address)}:{port}") as channel:
            await raw_unary(channel, "/test.Service/Note")(b"", timeout=5)
            assert AcceptedSockets(port).scan() == callers
    finally:
        await server.stop(0)
