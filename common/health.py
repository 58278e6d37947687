"""The standard health service (grpc.health.v1), as every server of the project offers it."""

import asyncio
from collections.abc import AsyncIterator
from typing import Literal, TypeAlias

import grpc
from grpc_health.v1.health_pb2 import HealthCheckRequest, HealthCheckResponse
from grpc_health.v1.health_pb2_grpc import HealthServicer, add_HealthServicer_to_server

from common.errors import UnknownServiceError
from common.interceptors import RpcContext

_State: TypeAlias = Literal[0, 1, 2, 3]
_SERVING = HealthCheckResponse.SERVING
_NOT_SERVING = HealthCheckResponse.NOT_SERVING
_UNKNOWN = HealthCheckResponse.SERVICE_UNKNOWN


class Health(HealthServicer):
    """The server as a whole (the empty name) serves as long as it answers; `set_serving` tells of its parts.

    Used on the server's event loop alone.

    Args:
        services: full names of services that serve as long as the server does.
    """

    def __init__(self, *services: str) -> None:
        self._states: dict[str, _State] = dict.fromkeys(("", *services), _SERVING)
        self._changed = asyncio.Event()

    def register(self, server: grpc.aio.Server) -> None:
        """Adds the service to a server that has not been started."""
        add_HealthServicer_to_server(self, server)

    def set_serving(self, service: str, *, serving: bool) -> None:
        """Tells how a part is; those who watch learn it when it is news."""
        state = _SERVING if serving else _NOT_SERVING
        if self._states.get(service) == state:
            return
        self._states[service] = state
        self._changed.set()
        self._changed = asyncio.Event()

    async def Check(  # noqa: N802  # the schema names it
        self, request: HealthCheckRequest, context: RpcContext
    ) -> HealthCheckResponse:
        """The state now."""
        state = self._states.get(request.service)
        if state is None:
            raise UnknownServiceError(f"no service '{request.service}' is known here")
        return HealthCheckResponse(status=state)

    async def Watch(  # noqa: N802  # the schema names it
        self, request: HealthCheckRequest, context: RpcContext
    ) -> AsyncIterator[HealthCheckResponse]:
        """The state now and whenever it changes, until the caller leaves."""
        last = None
        while True:
            changed = self._changed
            state = self._states.get(request.service, _UNKNOWN)
            if state != last:
                last = state
                yield HealthCheckResponse(status=state)
            await changed.wait()
