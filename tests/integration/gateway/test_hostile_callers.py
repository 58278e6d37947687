"""A gateway among callers that mean no good: it stays up, stays small, and others notice nothing."""

import select
import socket
import threading
import time
from collections.abc import Iterator
from typing import Any, Self

import grpc
import psutil
import pytest

from tests.support.gateway_program import GatewayProgram, gateway_program
from tests.support.hostile import CONVERSATIONS, PATIENCE_S, converse, half_connections
from tests.support.waiting import wait_until

STATUS = "/omniseer.gateway.v1.RobotGateway/GetSystemStatus"
SWITCH = "/omniseer.gateway.v1.RobotGateway/SetPreviewMode"
MIB = 1024 * 1024
MAY_GROW_MIB = 48
_UNKNOWN_FIELD = b"\xfa\x01"  # number 31, a length and as many bytes


class GoodCaller:
    """Asks again and again, on a connection of its own."""

    def __init__(self, gateway: GatewayProgram) -> None:
        self._gateway = gateway
        self._leave = threading.Event()
        self._thread = threading.Thread(target=self._ask)
        self.answers = 0
        self.troubles: list[grpc.RpcError] = []

    def __enter__(self) -> Self:
        self._thread.start()
        wait_until(lambda: self.answers > 5, "the good caller is served", PATIENCE_S)
        return self

    def __exit__(self, *_: object) -> None:
        self._leave.set()
        self._thread.join(PATIENCE_S)

    def still_served(self) -> None:
        """Waits for new answers; whatever went wrong since the beginning fails the test."""
        before = self.answers
        wait_until(
            lambda: self.answers > before + 5 or self.troubles, "the good caller is served", PATIENCE_S
        )
        assert not self.troubles

    def _ask(self) -> None:
        while not self._leave.wait(0.02):
            try:
                self._gateway.status()
                self.answers += 1
            except grpc.RpcError as error:
                self.troubles.append(error)


@pytest.fixture(scope="module")
def gateway(tmp_path_factory: pytest.TempPathFactory) -> Iterator[GatewayProgram]:
    with gateway_program(tmp_path_factory.mktemp("gateway"), sources=[]) as program:
        yield program


@pytest.fixture
def good(gateway: GatewayProgram) -> Iterator[GoodCaller]:
    with GoodCaller(gateway) as caller:
        yield caller


def resident_mib(gateway: GatewayProgram) -> float:
    return float(psutil.Process(gateway.process.pid).memory_info().rss) / MIB


def descriptors(gateway: GatewayProgram) -> int:
    return int(psutil.Process(gateway.process.pid).num_fds())


def unary(
    gateway: GatewayProgram, method: str, request: bytes, *, after_a_good_one: bool = False, **options: Any
) -> bytes:
    """One call with a body as it is, over a connection of its own.

    After a good one the connection is known; a stranger that sends megabytes is not answered at all.
    """
    no_limit = (("grpc.max_send_message_length", -1), ("grpc.use_local_subchannel_pool", 1))
    with grpc.insecure_channel(f"127.0.0.1:{gateway.port}", options=no_limit) as channel:
        call: grpc.UnaryUnaryMultiCallable[bytes, bytes]
        if after_a_good_one:
            call = channel.unary_unary(STATUS)
            call(b"", timeout=PATIENCE_S)
        call = channel.unary_unary(method)
        return call(request, timeout=PATIENCE_S, **options)


@pytest.mark.parametrize("said", CONVERSATIONS.values(), ids=CONVERSATIONS)
def test_a_conversation_that_makes_no_sense(gateway: GatewayProgram, good: GoodCaller, said: bytes) -> None:
    converse(gateway.port, said)  # whatever happens only once
    small, few = resident_mib(gateway), descriptors(gateway)
    for _ in range(3):
        converse(gateway.port, said)
    good.still_served()
    wait_until(lambda: descriptors(gateway) <= few, "their connections are gone", PATIENCE_S)
    assert resident_mib(gateway) - small < MAY_GROW_MIB
    assert gateway.process.poll() is None


@pytest.mark.parametrize("method", [STATUS, SWITCH])
@pytest.mark.parametrize("compression", [grpc.Compression.NoCompression, grpc.Compression.Gzip])
def test_a_message_far_too_large(
    gateway: GatewayProgram, good: GoodCaller, method: str, compression: grpc.Compression
) -> None:
    # Zeros: 64 MiB of them are 64 KiB on the wire when they are compressed.
    bomb = _UNKNOWN_FIELD + b"\x80\x80\x80\x20" + bytes(64 * MIB)
    small = resident_mib(gateway)
    for _ in range(3):
        with pytest.raises(grpc.RpcError) as refused:
            unary(gateway, method, bomb, compression=compression, after_a_good_one=True)
        assert refused.value.code() is grpc.StatusCode.RESOURCE_EXHAUSTED
    good.still_served()
    assert resident_mib(gateway) - small < MAY_GROW_MIB


def test_a_message_of_the_greatest_size_is_only_noise(gateway: GatewayProgram) -> None:
    """So the limit is what refuses the larger ones."""
    assert unary(gateway, STATUS, _UNKNOWN_FIELD + b"\xa0\x8d\x06" + bytes(100_000))


def test_callers_that_never_finish_their_first_word(gateway: GatewayProgram, good: GoodCaller) -> None:
    few = descriptors(gateway)
    with half_connections(gateway.port, 200) as callers:
        good.still_served()
        began_s = time.monotonic()
        waiting = set(callers)
        while waiting and time.monotonic() - began_s < 2 * PATIENCE_S:
            readable, _, _ = select.select(list(waiting), [], [], 1)
            waiting -= {caller for caller in readable if _hung_up(caller)}
        assert not waiting, "they are hung up on"
        wait_until(lambda: descriptors(gateway) <= few, "nothing is left of them", PATIENCE_S)
    good.still_served()


def _hung_up(caller: socket.socket) -> bool:
    try:
        return caller.recv(65_536) == b""
    except ConnectionError:
        return True
