"""What tools that know nothing of this project see: health, reflection, and calls by reflection alone."""

import asyncio
import json
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import grpc
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, json_format, message_factory
from grpc_health.v1.health_pb2 import HealthCheckRequest, HealthCheckResponse
from grpc_health.v1.health_pb2_grpc import HealthStub
from grpc_reflection.v1alpha.proto_reflection_descriptor_database import ProtoReflectionDescriptorDatabase

from tests.support.eventually import eventually
from tests.support.preview_double import PreviewDouble, serve_double
from tests.support.running_gateway import Operator, running_gateway

SERVICE = "omniseer.gateway.v1.RobotGateway"
LOCKED_IMAGE = Path(__file__).parents[3] / "proto/locked/gateway-v1.binpb"


@pytest.fixture
async def operator(tmp_path: Path) -> AsyncIterator[Operator]:
    async with running_gateway(tmp_path / "preview.sock", name="lab") as operator:
        yield operator


async def state_of(operator: Operator, service: str) -> int:
    stub: Any = HealthStub(operator.channel)  # its type has no methods
    answer = await stub.Check(HealthCheckRequest(service=service), timeout=5)
    return int(answer.status)


@pytest.mark.parametrize("service", ["", SERVICE])
async def test_the_gateway_serves(operator: Operator, service: str) -> None:
    assert await state_of(operator, service) == HealthCheckResponse.SERVING


async def test_the_preview_is_a_name_of_its_own(operator: Operator, tmp_path: Path) -> None:
    assert await state_of(operator, "preview") == HealthCheckResponse.NOT_SERVING
    server = await serve_double(tmp_path / "preview.sock", PreviewDouble())
    try:
        await eventually(
            lambda: state_of(operator, "preview"), lambda it: it == HealthCheckResponse.SERVING, "it serves"
        )
    finally:
        await server.stop(None)


class Stranger:
    """Talks to a gateway by descriptors alone, as grpcurl does: no generated code, JSON in and out.

    Args:
        pool: where the descriptors are from.
    """

    def __init__(self, channel: grpc.Channel, pool: descriptor_pool.DescriptorPool) -> None:
        self._channel = channel
        self._service = pool.FindServiceByName(SERVICE)

    @property
    def methods(self) -> set[str]:
        return set(self._service.methods_by_name)

    def unary(self, method: str, request: dict[str, Any]) -> Any:
        return self._prepared(self._channel.unary_unary, method)(self._message(method, request), timeout=10)

    def stream(self, method: str, request: dict[str, Any]) -> Any:
        return self._prepared(self._channel.unary_stream, method)(self._message(method, request), timeout=10)

    def _message(self, method: str, request: dict[str, Any]) -> Any:
        kind = message_factory.GetMessageClass(self._service.methods_by_name[method].input_type)
        return json_format.ParseDict(request, kind())

    def _prepared(self, kind: Any, method: str) -> Any:
        answer = message_factory.GetMessageClass(self._service.methods_by_name[method].output_type)
        return kind(
            f"/{SERVICE}/{method}",
            request_serializer=lambda message: message.SerializeToString(),
            response_deserializer=lambda data: json.loads(json_format.MessageToJson(answer.FromString(data))),
        )


def by_reflection(port: int) -> None:
    """Everything that is known here came over the wire."""
    with grpc.insecure_channel(f"127.0.0.1:{port}") as channel:
        database = ProtoReflectionDescriptorDatabase(channel)
        assert set(database.get_services()) >= {SERVICE, "grpc.health.v1.Health"}
        stranger = Stranger(channel, descriptor_pool.DescriptorPool(database))
        assert stranger.unary("GetSystemStatus", {})["gatewayName"] == "lab"
        assert stranger.unary("SetPreviewMode", {"enabled": False})["accepted"]
        watching = stranger.stream("WatchSystemStatus", {"minIntervalMs": 100})
        assert next(watching)["status"]["gatewayName"] == "lab"
        watching.cancel()
        events = stranger.stream("SubscribeEvents", {})
        kinds = {key for item in (next(events) for _ in range(2)) for key in item.get("event", item)}
        assert kinds & {"controlAction", "runId", "sequence"}
        events.cancel()
        with pytest.raises(grpc.RpcError) as refused:
            stranger.unary("SetPreviewMode", {"enabled": True, "profile": 99})
        assert refused.value.code() is grpc.StatusCode.INVALID_ARGUMENT


def from_the_locked_image(port: int) -> None:
    """A tool of the field, made from what was frozen: it knows nothing of what came later."""
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(LOCKED_IMAGE.read_bytes()).file:
        pool.Add(file)
    with grpc.insecure_channel(f"127.0.0.1:{port}") as channel:
        stranger = Stranger(channel, pool)
        assert stranger.methods >= {"GetSystemStatus", "SetPreviewMode", "GetOverlaySnapshot"}
        assert "WatchSystemStatus" not in stranger.methods
        status = stranger.unary("GetSystemStatus", {})
        assert status["gatewayName"] == "lab"
        assert status["health"]["summary"] == "robot healthy"
        assert stranger.unary("SetPreviewMode", {"enabled": False})["accepted"]
        assert stranger.unary("GetOverlaySnapshot", {})["status"]["gatewayName"] == "lab"


async def test_a_tool_that_knows_nothing_finds_its_way_by_reflection(operator: Operator) -> None:
    await asyncio.to_thread(by_reflection, operator.port)


async def test_a_client_of_the_frozen_contract_works(operator: Operator) -> None:
    await asyncio.to_thread(from_the_locked_image, operator.port)
