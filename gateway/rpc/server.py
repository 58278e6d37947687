"""The operator's server: every method of the contract, bound and started."""

import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final

import grpc
from google.protobuf.message import Message

from common.health import Health
from common.listen import bind_tcp, bracketed
from common.rpc import STOP_GRACE_S, Handler, Observe, new_server, unobserved
from gateway.rpc.servicer import RobotGateway
from gateway.rpc.tally import Behavior
from omniseer.gateway.v1.robot_gateway_pb2 import (
    DESCRIPTOR,
    GetGatewayInfoRequest,
    GetOverlaySnapshotRequest,
    GetSystemStatusRequest,
    SetPreviewModeRequest,
)

_log = logging.getLogger(__name__)

SERVICE: Final = DESCRIPTOR.services_by_name["RobotGateway"].full_name


def method_handlers(gateway: RobotGateway) -> dict[str, Handler]:
    """The contract's method names and who answers them, counted. Total: a test compares with the schema."""
    methods: dict[str, tuple[Behavior, type[Message]]] = {
        "GetSystemStatus": (gateway.get_system_status, GetSystemStatusRequest),
        "GetOverlaySnapshot": (gateway.get_overlay_snapshot, GetOverlaySnapshotRequest),
        "SetPreviewMode": (gateway.set_preview_mode, SetPreviewModeRequest),
        "GetGatewayInfo": (gateway.get_gateway_info, GetGatewayInfoRequest),
    }
    return {
        name: _unary(gateway.tally.counted(name, behavior), request)
        for name, (behavior, request) in methods.items()
    }


@asynccontextmanager
async def serving(
    gateway: RobotGateway,
    host: str,
    port: int,
    health: Health | None = None,
    observe: Observe = unobserved,
) -> AsyncIterator[int]:
    """Serves until the block ends; calls that are running then get STOP_GRACE_S to finish.

    Args:
        gateway: answers the contract's methods.
        host: an address of this machine.
        port: 0 takes any free one.
        health: answers the health service; by default one that knows the contract's service alone.
        observe: told of every call that ends.

    Yields:
        The port.

    Raises:
        UserError: the address can't be bound.
    """
    server = new_server(observe=observe)
    server.add_generic_rpc_handlers(
        (grpc.method_handlers_generic_handler(SERVICE, method_handlers(gateway)),)
    )
    (health or Health(SERVICE)).register(server)
    bound = bind_tcp(server, host, port)
    await server.start()
    _log.info("serving operators at %s:%d", bracketed(host), bound)
    try:
        yield bound
    finally:
        await server.stop(STOP_GRACE_S)


def _unary(behavior: Behavior, request: type[Message]) -> Handler:
    """A handler whose replies are bytes already."""
    return grpc.unary_unary_rpc_method_handler(behavior, request.FromString, None)
