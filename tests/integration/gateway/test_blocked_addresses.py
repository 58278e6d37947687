"""Addresses that the kernel lets connect no more."""

import asyncio
import socket
import time
from collections.abc import Awaitable, Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import grpc
import pytest

from bench.siege.crowd import Crowd
from gateway.access.address_prefix import address_prefix
from gateway.access.role import Role
from gateway.rpc.calls.call import CallContext
from gateway.rpc.connections.accepted_sockets import AcceptedSockets
from gateway.rpc.connections.blocklist import MAX_BLOCKED, MAX_TRUSTED, UNUSED_BURST
from gateway.rpc.connections.guard import SCAN_EVERY_S
from gateway.rpc.connections.packet_filter import ConnectPolicy
from gateway.rpc.connections.refusal_delay import REFUSAL_SPACING_S
from gateway.rpc.connections.shedding import MAX_ONE_IN
from gateway.rpc.interceptors.auth import Auth
from gateway.rpc.interceptors.turns import EXAMINED
from omniseer.gateway.v1.robot_gateway_pb2 import GetSystemStatusRequest
from omniseer.gateway.v1.robot_gateway_pb2_grpc import RobotGatewayStub
from omniseer.gateway.v1.teleop_pb2 import StopRobotRequest
from omniseer.gateway.v1.teleop_pb2_grpc import TeleopServiceStub
from tests.support.eventually import eventually
from tests.support.guarded_gateway import guarded_gateway, new_robot
from tests.support.http2 import GET_SYSTEM_STATUS, STOP_ROBOT

SOON_S = 0.3
WRONG_TOKEN = "rgt-000000000000." + "A" * 43


def blocking(prefixes: list[str]) -> ConnectPolicy:
    return ConnectPolicy(frozenset(prefixes))


def can_connect(server: socket.socket, source: str) -> bool:
    try:
        with socket.create_connection(server.getsockname()[:2], timeout=SOON_S, source_address=(source, 0)):
            return True
    except TimeoutError:
        return False


def test_a_blocked_address_can_not_connect_and_others_can() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        sockets = AcceptedSockets(server.getsockname()[1])
        sockets.scan()
        assert sockets.apply(blocking(["127.0.5.1", "127.0.5.2"]))
        assert not can_connect(server, "127.0.5.1")
        assert not can_connect(server, "127.0.5.2")
        assert can_connect(server, "127.0.5.3")
        assert sockets.apply(blocking(["127.0.5.3"]))
        assert can_connect(server, "127.0.5.1")
        assert not can_connect(server, "127.0.5.3")
        assert sockets.apply(blocking([]))
        assert can_connect(server, "127.0.5.3")


def test_who_is_connected_stays_connected() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        sockets = AcceptedSockets(server.getsockname()[1])
        with socket.create_connection(server.getsockname(), source_address=("127.0.5.1", 0)) as caller:
            accepted, _ = server.accept()
            with accepted:
                sockets.scan()
                assert sockets.apply(blocking(["127.0.5.1"]))
                caller.sendall(b"still here")
                assert accepted.recv(16) == b"still here"


def test_as_many_as_may_be_blocked_of_both_families() -> None:
    """The program for all of them has more instructions than a conditional jump reaches."""
    crowd = [f"10.0.0.{number}" for number in range(MAX_BLOCKED // 2)]
    crowd += [f"2001:db8:0:{number:x}::" for number in range(MAX_BLOCKED // 2)]
    with socket.create_server(("127.0.0.1", 0)) as server:
        sockets = AcceptedSockets(server.getsockname()[1])
        sockets.scan()
        assert sockets.apply(blocking([*crowd, "127.0.5.1"]))
        assert not can_connect(server, "127.0.5.1")
        assert can_connect(server, "127.0.5.2")
        many = [f"2001:db8:0:{number:x}::" for number in range(MAX_BLOCKED)]
        assert sockets.apply(blocking(many))
        assert can_connect(server, "127.0.5.1")


@pytest.mark.skipif(not Path("/proc/net/if_inet6").exists(), reason="this machine has no IPv6")
def test_a_listener_for_both_families_blocks_both() -> None:
    with socket.create_server(("::", 0), family=socket.AF_INET6, dualstack_ipv6=True) as server:
        port = server.getsockname()[1]
        sockets = AcceptedSockets(port)
        sockets.scan()

        def connects(host: str) -> bool:
            try:
                with socket.create_connection((host, port), timeout=SOON_S):
                    return True
            except TimeoutError:
                return False

        assert sockets.apply(blocking([address_prefix("::1")]))
        assert (connects("::1"), connects("127.0.0.1")) == (False, True)
        assert sockets.apply(blocking(["127.0.0.1"]))
        assert (connects("::1"), connects("127.0.0.1")) == (True, False)
        assert sockets.apply(blocking(["2001:db8::", "0.0.0.1"]))
        assert (connects("::1"), connects("127.0.0.1")) == (True, True)


def test_of_a_crowd_a_share_connects_and_those_that_are_spared_do() -> None:
    """Chances are 1 in 10^11 that all of 40 attempts get through one in two, or none does."""
    with socket.create_server(("127.0.0.1", 0), backlog=100) as server:
        sockets = AcceptedSockets(server.getsockname()[1])
        sockets.scan()
        assert sockets.apply(ConnectPolicy(one_in=2, spared=frozenset({"127.0.5.1"})))
        assert all(can_connect(server, "127.0.5.1") for _ in range(40))
        connected = [can_connect(server, "127.0.5.2") for _ in range(40)]
        assert 0 < sum(connected) < 40
        assert sockets.apply(ConnectPolicy(frozenset({"127.0.5.3"}), 2, frozenset({"127.0.5.1"})))
        assert not any(can_connect(server, "127.0.5.3") for _ in range(5))


def test_who_was_let_through_connects_and_stays() -> None:
    """The packets after the first, of the handshake too, are not left to chance."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        sockets = AcceptedSockets(server.getsockname()[1])
        sockets.scan()
        with socket.create_connection(server.getsockname(), source_address=("127.0.5.1", 0)) as caller:
            assert sockets.apply(ConnectPolicy(one_in=MAX_ONE_IN))
            accepted, _ = server.accept()
            with accepted:
                for _ in range(100):
                    caller.sendall(b"?")
                    assert accepted.recv(1) == b"?"
                    accepted.sendall(b"!")
                    assert caller.recv(1) == b"!"


def test_the_largest_policy_is_permitted() -> None:
    """Of IPv6, whose comparisons take most instructions."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        sockets = AcceptedSockets(server.getsockname()[1])
        sockets.scan()
        policy = ConnectPolicy(
            frozenset(f"2001:db8:0:{number:x}::" for number in range(MAX_BLOCKED)),
            MAX_ONE_IN,
            frozenset(f"2001:db8:1:{number:x}::" for number in range(MAX_TRUSTED + 3)),
        )
        assert sockets.apply(policy)


async def test_an_address_that_connects_again_and_again_is_blocked_and_an_operator_is_not(
    tmp_path: Path,
) -> None:
    robot = new_robot(tmp_path)
    _, login = robot.add(Role.VIEWER)
    async with guarded_gateway(robot):

        def connect_again_and_again() -> int:
            """Returns how many connections there were until one was not accepted any more."""
            for number in range(10):
                with ExitStack() as stack:
                    for _ in range(UNUSED_BURST // 2):
                        try:
                            stack.enter_context(
                                socket.create_connection(
                                    ("127.0.0.1", robot.port), SOON_S, source_address=("127.0.6.1", 0)
                                )
                            )
                        except TimeoutError:
                            return number * UNUSED_BURST // 2
                    time.sleep(3 * SCAN_EVERY_S)  # until they have been seen
            pytest.fail("the address was not blocked")

        assert await asyncio.to_thread(connect_again_and_again) >= UNUSED_BURST
        stub = RobotGatewayStub(robot.channel())
        status: Any = await stub.GetSystemStatus(
            GetSystemStatusRequest(), metadata=login.metadata(), timeout=5
        )
        assert status.gateway_name
        # TCP tries again after one second, and after two more (RFC 6298): the first block has ended by then.
        again = await asyncio.to_thread(
            socket.create_connection, ("127.0.0.1", robot.port), 10, ("127.0.6.1", 0)
        )
        again.close()


@pytest.mark.parametrize("method", [GET_SYSTEM_STATUS, STOP_ROBOT], ids=["status", "stop"])
async def test_of_a_stranger_that_floods_few_calls_are_examined(
    method: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also of its stops, which are exempt from limits for those alone whom the robot knows."""
    refused, authenticate = 0, Auth.on_call

    async def counting(self: Auth, call: CallContext) -> None:
        nonlocal refused
        refused += 1
        await authenticate(self, call)

    monkeypatch.setattr(Auth, "on_call", counting)
    robot = new_robot(tmp_path)
    async with guarded_gateway(robot):
        crowd = Crowd(("127.0.0.1", robot.port))
        attack = asyncio.create_task(crowd.flood("127.0.6.2", WRONG_TOKEN, method))
        began_s = time.monotonic()
        await eventually(answered(crowd), lambda count: count > EXAMINED, "some calls are refused")
        took_s = time.monotonic() - began_s
        attack.cancel()
        await asyncio.wait([attack])
    assert refused <= 2 * EXAMINED + took_s / REFUSAL_SPACING_S


def answered(crowd: Crowd) -> Callable[[], Awaitable[int]]:
    async def look() -> int:
        return crowd.counts.refused

    return look


async def test_a_stop_of_a_viewer_does_not_wait_behind_its_wrong_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a connection that a wrong token fills. A robot that does not drive refuses it with a reason."""
    # So far apart that the way of the stop's answer takes the time of few of them, on a busy machine too.
    monkeypatch.setattr("gateway.rpc.connections.refusal_delay.REFUSAL_SPACING_S", 0.3)
    robot = new_robot(tmp_path)
    _, login = robot.add(Role.VIEWER)
    async with guarded_gateway(robot):
        stub: Any = TeleopServiceStub(robot.channel())
        wrong = [
            asyncio.ensure_future(
                stub.StopRobot(
                    StopRobotRequest(), metadata=(("authorization", f"Bearer {WRONG_TOKEN}"),), timeout=60
                )
            )
            for _ in range(4 * EXAMINED)
        ]
        # Which of them is the first one there, gRPC does not promise.
        refused, waiting = await asyncio.wait(wrong, return_when=asyncio.FIRST_COMPLETED)
        assert all(isinstance(each.exception(), grpc.aio.AioRpcError) for each in refused)
        assert waiting
        with pytest.raises(grpc.aio.AioRpcError) as seen:
            await stub.StopRobot(StopRobotRequest(), metadata=login.metadata(), timeout=30)
        left = sum(not each.done() for each in wrong)
        assert seen.value.code() is grpc.StatusCode.FAILED_PRECONDITION
        # Of those that had come before it none but the ones that are examined at a time went first.
        assert left > len(waiting) - EXAMINED
        for each in wrong:
            each.cancel()
        await asyncio.gather(*wrong, return_exceptions=True)


async def test_the_calls_of_an_operator_go_on_when_the_first_is_admitted(tmp_path: Path) -> None:
    robot = new_robot(tmp_path)
    _, login = robot.add(Role.VIEWER)
    async with guarded_gateway(robot):
        stub = RobotGatewayStub(robot.channel())
        answers: list[Any] = await asyncio.gather(
            *(
                stub.GetSystemStatus(
                    GetSystemStatusRequest(), metadata=login.metadata(), timeout=10, wait_for_ready=True
                )
                for _ in range(4 * EXAMINED)
            )
        )
        assert all(each.gateway_name for each in answers)
