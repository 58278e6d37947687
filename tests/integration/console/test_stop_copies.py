"""A stop goes out on two connections, as two copies of one request."""

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from itertools import count

import grpc
import pytest

from console.client import AsyncGatewayClient, Refused
from omniseer.gateway.v1.teleop_pb2 import StopLatch, StopRobotRequest, StopRobotResponse
from tests.support.gateway_double import serving_handlers

_BOTH_WITHIN_S = 10


Stop = Callable[[StopRobotRequest, grpc.ServicerContext], StopRobotResponse]


def served(stop: Stop) -> AbstractContextManager[int]:
    """A gateway that answers StopRobot; its port."""
    handler = grpc.unary_unary_rpc_method_handler(
        stop, StopRobotRequest.FromString, StopRobotResponse.SerializeToString
    )
    name = "omniseer.gateway.v1.TeleopService"
    return serving_handlers(grpc.method_handlers_generic_handler(name, {"StopRobot": handler}))


async def test_both_copies_of_a_stop_have_one_request_id_and_each_stop_its_own() -> None:
    both, taken = threading.Barrier(2), list[StopRobotRequest]()

    def stop(request: StopRobotRequest, _context: object) -> StopRobotResponse:
        taken.append(request)
        both.wait(_BOTH_WITHIN_S)
        return StopRobotResponse(message="stopped", stop=StopLatch(stop_id=len(taken)))

    with served(stop) as port:
        async with AsyncGatewayClient(f"127.0.0.1:{port}") as client:
            for _ in range(2):
                await client.stop_robot("a child")
    ids = [each.request_id for each in taken]
    assert ids[0] == ids[1] != ids[2] == ids[3]
    assert all(ids)


async def test_a_refused_copy_does_not_withdraw_the_other() -> None:
    """As where all connections of a caller are taken, so that the second one is refused."""
    copies, withdrawn = count(1), threading.Event()

    def stop(_request: StopRobotRequest, context: grpc.ServicerContext) -> StopRobotResponse:
        if next(copies) == 1:
            context.abort(grpc.StatusCode.RESOURCE_EXHAUSTED, "all connections are taken")
        context.add_callback(withdrawn.set)
        assert not withdrawn.wait(0.5), "the client has left"
        return StopRobotResponse(message="stopped", stop=StopLatch(stop_id=1))

    with served(stop) as port:
        async with AsyncGatewayClient(f"127.0.0.1:{port}") as client:
            assert (await client.stop_robot("a child")).stop.stop_id == 1


async def test_where_both_copies_fail_what_the_robot_says_counts() -> None:
    copies = count(1)

    def stop(_request: StopRobotRequest, context: grpc.ServicerContext) -> StopRobotResponse:
        said = grpc.StatusCode.FAILED_PRECONDITION if next(copies) == 1 else grpc.StatusCode.UNAVAILABLE
        context.abort(said, "the drive program has not confirmed the stop")

    with served(stop) as port:
        async with AsyncGatewayClient(f"127.0.0.1:{port}") as client:
            with pytest.raises(Refused, match="not confirmed"):
                await client.stop_robot("a child")
