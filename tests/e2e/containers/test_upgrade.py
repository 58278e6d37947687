"""A client from before this project's additions, made of the frozen image alone, and today's server."""

from typing import Any

import grpc
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

from tests.e2e.containers.deployment import Deployment, is_healthy
from tests.support.engine import ROOT
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.docker, pytest.mark.timeout(900)]

PACKAGE = "omniseer.gateway.v1"


class OldClient:
    """Knows the contract as it was frozen, and none of today's code."""

    def __init__(self, channel: grpc.Channel) -> None:
        self._channel = channel
        self._pool = descriptor_pool.DescriptorPool()
        image = (ROOT / "proto/locked/gateway-v1.binpb").read_bytes()
        for file in descriptor_pb2.FileDescriptorSet.FromString(image).file:
            self._pool.Add(file)

    def call(self, method: str, **fields: Any) -> Any:
        service = self._pool.FindServiceByName(f"{PACKAGE}.RobotGateway")
        described = service.methods_by_name[method]
        request = message_factory.GetMessageClass(described.input_type)(**fields)
        reply = message_factory.GetMessageClass(described.output_type)
        invoke = self._channel.unary_unary(
            f"/{service.full_name}/{method}",
            request_serializer=type(request).SerializeToString,
            response_deserializer=reply.FromString,
        )
        return invoke(request, timeout=10)


def test_an_old_client_reads_and_switches_a_new_server(demo: Deployment) -> None:
    with grpc.insecure_channel(f"127.0.0.1:{demo.gateway_port}") as channel:
        client = OldClient(channel)
        # A source that stood still with the machine is stale for a moment.
        status = wait_until(
            lambda: now if is_healthy(now := client.call("GetSystemStatus")) else None, "all is well"
        )
        assert not any(field.number >= 16 for field in status.DESCRIPTOR.fields), "this client is not old"
        assert status.health.ready
        assert status.health.linear_speed_mps == pytest.approx(0.5)
        assert status.vision.producer_fps > 0

        on = client.call("SetPreviewMode", enabled=True, profile=1)
        assert (on.accepted, on.preview.state, on.preview.profile) == (True, 2, 1)
        assert client.call("GetOverlaySnapshot").detections.detection_count == 3
        assert client.call("GetSystemStatus").preview.state == 2
        off = client.call("SetPreviewMode", enabled=False)
        assert (off.accepted, off.preview.state, off.preview.profile) == (True, 1, 1)
