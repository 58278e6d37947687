"""Health check for containers: exits 0 if a gRPC server reports SERVING, else 1.

`python -m common.healthcheck [TARGET [SERVICE]]`. TARGET defaults to the environment variable HEALTH_TARGET,
SERVICE to HEALTH_SERVICE, and without that to the server as a whole.
"""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NoReturn, Protocol

import grpc
from grpc_health.v1.health_pb2 import HealthCheckRequest, HealthCheckResponse
from grpc_health.v1.health_pb2_grpc import HealthStub

from common.errors import UserError

_TIMEOUT_S: Final = 3.0


def state_of(target: str, service: str = "") -> str:
    """Returns the serving status by name, or "CODE: details" of the gRPC error.

    Args:
        target: "HOST:PORT" or "unix:PATH".
        service: full name of a service, or another name that the server reports a status for.
    """
    with grpc.insecure_channel(target) as channel:
        stub: Any = HealthStub(channel)
        try:
            response = stub.Check(HealthCheckRequest(service=service), timeout=_TIMEOUT_S)
        except grpc.RpcError as error:
            return f"{error.code().name}: {error.details()}"
    return HealthCheckResponse.ServingStatus.Name(response.status)


class SocketSettings(Protocol):
    """Settings of a program that serves a Unix socket."""

    @property
    def socket(self) -> Path:
        """The socket."""


def check_program(
    load_settings: Callable[[Path | None], SocketSettings], variable: str, service: str = ""
) -> NoReturn:
    """Checks the gRPC server of a configured program, and exits.

    Args:
        load_settings: reads the file; raises a `UserError`.
        variable: of the environment; names the file. Unset or empty: there is none.
        service: as of `state_of`.
    """
    socket = _configured_socket(load_settings, variable)
    _exit(str(socket), state_of(f"unix:{socket}", service))


def check_state(
    load_settings: Callable[[Path | None], SocketSettings], variable: str, state: Callable[[Path], str]
) -> None:
    """Checks a configured program that serves another protocol, and exits unless it reports its state.

    Args:
        load_settings: reads the file; raises a `UserError`.
        variable: of the environment; names the file. Unset or empty: there is none.
        state: asks the program at this socket, and returns its state in a word; raises a `UserError`.
    """
    socket = _configured_socket(load_settings, variable)
    try:
        print(f"{socket}: {state(socket)}")
    except UserError as error:
        raise SystemExit(str(error)) from error


def main() -> None:
    """Runs the check and exits."""
    target = sys.argv[1] if len(sys.argv) > 1 else os.environ.get("HEALTH_TARGET", "")
    if not target:
        raise SystemExit("error: no target. Name one, 127.0.0.1:50051 for example, or set HEALTH_TARGET")
    service = sys.argv[2] if len(sys.argv) > 2 else os.environ.get("HEALTH_SERVICE", "")
    _exit(target, state_of(target, service))


def _configured_socket(load_settings: Callable[[Path | None], SocketSettings], variable: str) -> Path:
    named = os.environ.get(variable)
    try:
        return load_settings(Path(named) if named else None).socket
    except UserError as error:
        raise SystemExit(str(error)) from error


def _exit(where: str, state: str) -> NoReturn:
    print(f"{where}: {state}")
    raise SystemExit(0 if state == "SERVING" else 1)


if __name__ == "__main__":
    main()
