"""The operator's server: every method of the contract, bound and started."""

import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Final

import grpc
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass
from grpc_health.v1.health import SERVICE_NAME as HEALTH_SERVICE
from grpc_reflection.v1alpha.reflection import SERVICE_NAME as REFLECTION_SERVICE
from grpc_reflection.v1alpha.reflection import enable_server_reflection

from common.bind import bind_tcp, bind_unix, bracketed
from common.health import Health
from common.rpc import STOP_GRACE_S, Context, Handler, Observe, new_server, unobserved
from gateway.rpc.counting import CountingInterceptor
from gateway.rpc.guard import Guard
from gateway.rpc.limiting import LimitInterceptor
from gateway.rpc.limits import MOST_REQUEST_BYTES, Admission, Limits
from gateway.rpc.peer import address_of
from gateway.rpc.requests import Requests, hold_to_rules
from gateway.rpc.servicer import RobotGateway
from gateway.rpc.tally import Behavior, StreamBehavior
from omniseer.gateway.v1.access_pb2 import ROLE_VIEWER, required_role
from omniseer.gateway.v1.robot_gateway_pb2 import DESCRIPTOR

_log = logging.getLogger(__name__)

_CONTRACT: Final = DESCRIPTOR.services_by_name["RobotGateway"]
_METHODS: Final = _CONTRACT.methods_by_name
SERVICE: Final = _CONTRACT.full_name


def method_handlers(gateway: RobotGateway, most_bytes: int = MOST_REQUEST_BYTES) -> dict[str, Handler]:
    """The contract's method names and who answers them. Total: a test compares with the schema.

    Args:
        gateway: answers them.
        most_bytes: longer requests are refused.
    """
    unary: dict[str, Behavior] = {
        "GetSystemStatus": gateway.get_system_status,
        "GetOverlaySnapshot": gateway.get_overlay_snapshot,
        "SetPreviewMode": gateway.set_preview_mode,
        "GetGatewayInfo": gateway.get_gateway_info,
        "Ping": gateway.ping,
    }
    streams: dict[str, StreamBehavior] = {
        "WatchSystemStatus": gateway.watch_system_status,
        "SubscribeEvents": gateway.subscribe_events,
    }
    return {
        **{name: _unary(gateway, name, behavior, most_bytes) for name, behavior in unary.items()},
        **{name: _stream(gateway, name, behavior, most_bytes) for name, behavior in streams.items()},
    }


@asynccontextmanager
async def serving(
    gateway: RobotGateway,
    host: str,
    port: int,
    health: Health | None = None,
    *,
    observe: Observe = unobserved,
    limits: Limits | None = None,
    guard: Guard | None = None,
    credentials: grpc.ServerCredentials | None = None,
    socket: Path | None = None,
) -> AsyncIterator[int]:
    """Serves until the block ends; calls that are running then get STOP_GRACE_S to finish.

    Args:
        gateway: answers the contract's methods.
        host: an address of this machine.
        port: 0 takes any free one.
        health: answers the health service; by default one that knows the contract's service alone.
        observe: told of every call that ends.
        limits: what callers may have; by default what the class says.
        guard: asks callers who they are; None lets everybody in.
        credentials: what connections are encrypted with; None for plaintext.
        socket: a Unix socket to serve on as well.

    Yields:
        The port.

    Raises:
        UserError: the address can't be bound.
    """
    limits = limits or Limits()
    handlers = method_handlers(gateway, limits.request_bytes)
    counting = CountingInterceptor(gateway.tally, SERVICE, handlers)
    limiting = LimitInterceptor(Admission(limits))
    server = new_server([counting, limiting, *([guard] if guard else [])], observe)
    server.add_generic_rpc_handlers((grpc.method_handlers_generic_handler(SERVICE, handlers),))
    (health or Health(SERVICE)).register(server)
    enable_server_reflection((SERVICE, HEALTH_SERVICE, REFLECTION_SERVICE), server)
    bound = bind_tcp(server, host, port, credentials)
    if socket:
        bind_unix(server, socket)
    await server.start()
    how = "plaintext" if credentials is None else "TLS"
    whom = "everybody" if guard is None else "those with a credential"
    _log.info("serving operators at %s:%d (%s, %s)", bracketed(host), bound, how, whom)
    try:
        yield bound
    finally:
        await server.stop(STOP_GRACE_S)


def _unary(gateway: RobotGateway, name: str, behavior: Behavior, most_bytes: int) -> Handler:
    """A handler whose requests and replies are bytes."""
    request, reply = _messages(name)
    requests = Requests(request, most_bytes)

    async def held_to_rules(message: Message, context: Context) -> bytes:
        hold_to_rules(message)
        return await behavior(message, context)

    # What has no field can break no rule.
    inner: Behavior = held_to_rules if request.DESCRIPTOR.fields else behavior
    if changes_the_robot(name):
        inner = gateway.controls.told(name, inner, reply)

    async def call(data: bytes, context: Context) -> bytes:
        gateway.tally.note(context.peer())
        return await inner(requests.read(data), context)

    return grpc.unary_unary_rpc_method_handler(call, None, None)


def _stream(gateway: RobotGateway, name: str, behavior: StreamBehavior, most_bytes: int) -> Handler:
    """The same for a stream of replies; whoever has one open stays."""
    request, _ = _messages(name)
    requests, staying = Requests(request, most_bytes), gateway.streams.staying

    async def call(data: bytes, context: Context) -> AsyncIterator[bytes]:
        peer = context.peer()
        gateway.tally.note(peer)
        message = requests.read(data)
        hold_to_rules(message)
        with staying.stream(address_of(peer)):
            async for reply in behavior(message, context):
                yield reply

    return grpc.unary_stream_rpc_method_handler(call, None, None)


def changes_the_robot(method: str) -> bool:
    """Whether it takes more than a viewer to call it, by the schema."""
    role = _METHODS[method].GetOptions().Extensions[required_role]
    return role != ROLE_VIEWER


def _messages(method: str) -> tuple[type[Message], type[Message]]:
    """Of the request and the reply."""
    found = _METHODS[method]
    return GetMessageClass(found.input_type), GetMessageClass(found.output_type)
