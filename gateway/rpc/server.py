"""The operator's server: every method of the contract, bound and started."""

import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final

import grpc
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass

from common.health import Health
from common.listen import bind_tcp, bracketed
from common.rpc import STOP_GRACE_S, Context, Handler, Observe, new_server, unobserved
from gateway.rpc.caller import address_of
from gateway.rpc.servicer import RobotGateway
from gateway.rpc.tally import Behavior, StreamBehavior
from omniseer.gateway.v1.access_pb2 import ROLE_VIEWER, required_role
from omniseer.gateway.v1.robot_gateway_pb2 import DESCRIPTOR

_log = logging.getLogger(__name__)

_CONTRACT: Final = DESCRIPTOR.services_by_name["RobotGateway"]
_METHODS: Final = _CONTRACT.methods_by_name
SERVICE: Final = _CONTRACT.full_name


def method_handlers(gateway: RobotGateway) -> dict[str, Handler]:
    """The contract's method names and who answers them, counted. Total: a test compares with the schema."""
    return {
        "GetSystemStatus": _unary(gateway, "GetSystemStatus", gateway.get_system_status),
        "GetOverlaySnapshot": _unary(gateway, "GetOverlaySnapshot", gateway.get_overlay_snapshot),
        "SetPreviewMode": _unary(gateway, "SetPreviewMode", gateway.set_preview_mode),
        "GetGatewayInfo": _unary(gateway, "GetGatewayInfo", gateway.get_gateway_info),
        "WatchSystemStatus": _stream(gateway, "WatchSystemStatus", gateway.watch_system_status),
        "SubscribeEvents": _stream(gateway, "SubscribeEvents", gateway.subscribe_events),
        "Ping": _unary(gateway, "Ping", gateway.ping),
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


def _unary(gateway: RobotGateway, name: str, behavior: Behavior) -> Handler:
    """A handler whose replies are bytes already."""
    request, reply = _messages(name)
    if changes_the_robot(name):
        behavior = gateway.controls.told(name, behavior, reply)
    return grpc.unary_unary_rpc_method_handler(
        gateway.tally.counted(name, behavior), request.FromString, None
    )


def _stream(gateway: RobotGateway, name: str, behavior: StreamBehavior) -> Handler:
    """The same for a stream of replies; whoever has one open stays."""
    request, _ = _messages(name)
    counted, staying = gateway.tally.counted_stream(name, behavior), gateway.streams.staying

    async def call(message: Message, context: Context) -> AsyncIterator[bytes]:
        with staying.stream(address_of(context.peer())):
            async for reply in counted(message, context):
                yield reply

    return grpc.unary_stream_rpc_method_handler(call, request.FromString, None)


def changes_the_robot(method: str) -> bool:
    """Whether it takes more than a viewer to call it, by the schema."""
    role = _METHODS[method].GetOptions().Extensions[required_role]
    return role != ROLE_VIEWER


def _messages(method: str) -> tuple[type[Message], type[Message]]:
    """Of the request and the reply."""
    found = _METHODS[method]
    return GetMessageClass(found.input_type), GetMessageClass(found.output_type)
