"""The standard health service (grpc.health.v1), offered by every server of the project.

The asyncio servicer of grpc_health (1.85) is not used. Its Check of an unknown service has no error details.
Its Watch is a coroutine that writes to the context, which interceptors of response iterators can't wrap; and
it writes while it holds the lock that `set` needs, so one watcher that does not read blocks `set` and others.
"""

from collections.abc import AsyncIterator
from typing import Final, Literal, TypeAlias

import grpc
from grpc_health.v1.health_pb2 import HealthCheckRequest, HealthCheckResponse
from grpc_health.v1.health_pb2_grpc import HealthServicer, add_HealthServicer_to_server

from common.broadcast import Broadcast
from common.errors import UnknownServiceError
from common.interceptors import RpcContext
from common.printable import printable

_Status: TypeAlias = Literal[0, 1, 2, 3]

_QUOTED_CHARACTERS: Final = 64
"""Of an unknown service's name, in its refusal: a request may have 256 KiB of it."""


class Health(HealthServicer):
    """Serving status by service name; the empty name is the server itself, SERVING as long as it responds.

    Used on the server's event loop alone.

    Args:
        services: full names of further services that are SERVING as long as the server is.
    """

    def __init__(self, *services: str) -> None:
        self._statuses: dict[str, _Status] = dict.fromkeys(("", *services), HealthCheckResponse.SERVING)
        self._changes = Broadcast()

    def register(self, server: grpc.aio.Server) -> None:
        """Adds the service to a server that has not been started."""
        add_HealthServicer_to_server(self, server)

    def set_serving(self, service: str, *, serving: bool) -> None:
        """Sets the status of a service to SERVING or NOT_SERVING; watchers are sent each change."""
        status = HealthCheckResponse.SERVING if serving else HealthCheckResponse.NOT_SERVING
        if self._statuses.get(service) != status:
            self._statuses[service] = status
            self._changes.notify_all()

    async def Check(  # noqa: N802  # the schema names it
        self, request: HealthCheckRequest, _context: RpcContext
    ) -> HealthCheckResponse:
        """Returns the current status.

        Raises:
            UnknownServiceError: no status was ever set for this service.
        """
        status = self._statuses.get(request.service)
        if status is None:
            name = printable(request.service[:_QUOTED_CHARACTERS])
            raise UnknownServiceError(f"the service '{name}' is unknown here")
        return HealthCheckResponse(status=status)

    async def Watch(  # noqa: N802  # the schema names it
        self, request: HealthCheckRequest, _context: RpcContext
    ) -> AsyncIterator[HealthCheckResponse]:
        """Yields the current status, then each change; SERVICE_UNKNOWN until the first `set_serving`."""
        sent: _Status | None = None

        def changed() -> bool:
            return self._statuses.get(request.service, HealthCheckResponse.SERVICE_UNKNOWN) != sent

        while True:
            await self._changes.wait_until(changed)
            sent = self._statuses.get(request.service, HealthCheckResponse.SERVICE_UNKNOWN)
            yield HealthCheckResponse(status=sent)
