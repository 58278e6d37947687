"""The operator's server: every method of the contract, bound and started."""

import logging
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any, Final

import grpc
from google.protobuf.message import Message

from common.health import Health
from common.listen import bind_tcp, bracketed
from common.rpc import STOP_GRACE_S, Handler, new_server
from gateway.rpc.servicer import RobotGateway
from omniseer.gateway.v1.robot_gateway_pb2 import (
    DESCRIPTOR,
    GetOverlaySnapshotRequest,
    GetSystemStatusRequest,
    SetPreviewModeRequest,
)

_log = logging.getLogger(__name__)

SERVICE: Final = DESCRIPTOR.services_by_name["RobotGateway"].full_name


def method_handlers(gateway: RobotGateway) -> dict[str, Handler]:
    """The contract's method names and who answers them. Total: a test compares with the schema."""
    return {
        "GetSystemStatus": _unary(gateway.get_system_status, GetSystemStatusRequest),
        "GetOverlaySnapshot": _unary(gateway.get_overlay_snapshot, GetOverlaySnapshotRequest),
        "SetPreviewMode": _unary(gateway.set_preview_mode, SetPreviewModeRequest),
    }


@asynccontextmanager
async def serving(
    gateway: RobotGateway, host: str, port: int, health: Health | None = None
) -> AsyncIterator[int]:
    """Serves until the block ends; calls that are running then get STOP_GRACE_S to finish.

    Args:
        gateway: answers the contract's methods.
        host: an address of this machine.
        port: 0 takes any free one.
        health: answers the health service; by default one that knows the contract's service alone.

    Yields:
        The port.

    Raises:
        UserError: the address can't be bound.
    """
    server = new_server()
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


def _unary(behavior: Callable[[Any, Any], Awaitable[bytes]], request: type[Message]) -> Handler:
    """A handler whose replies are bytes already."""
    return grpc.unary_unary_rpc_method_handler(behavior, request.FromString, None)
