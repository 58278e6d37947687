"""A stop goes out on two connections, as two copies of one request."""

import threading

import grpc

from console.client import AsyncGatewayClient
from omniseer.gateway.v1.teleop_pb2 import StopLatch, StopRobotRequest, StopRobotResponse
from tests.support.gateway_double import serving_handlers

_BOTH_WITHIN_S = 10


async def test_both_copies_of_a_stop_have_one_request_id_and_each_stop_its_own() -> None:
    both, taken = threading.Barrier(2), list[StopRobotRequest]()

    def stop(request: StopRobotRequest, _context: object) -> StopRobotResponse:
        taken.append(request)
        both.wait(_BOTH_WITHIN_S)
        return StopRobotResponse(message="stopped", stop=StopLatch(stop_id=len(taken)))

    handler = grpc.unary_unary_rpc_method_handler(
        stop, StopRobotRequest.FromString, StopRobotResponse.SerializeToString
    )
    service = grpc.method_handlers_generic_handler(
        "omniseer.gateway.v1.TeleopService", {"StopRobot": handler}
    )
    with serving_handlers(service) as port:
        async with AsyncGatewayClient(f"127.0.0.1:{port}") as client:
            for _ in range(2):
                await client.stop_robot("a child")
    ids = [each.request_id for each in taken]
    assert ids[0] == ids[1] != ids[2] == ids[3]
    assert all(ids)
