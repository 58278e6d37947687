"""Health check for containers: exits 0 if a gRPC server reports SERVING, else 1.

`python -m common.healthcheck [TARGET [SERVICE]]`. TARGET defaults to the environment variable HEALTH_TARGET,
SERVICE to the server as a whole.
"""

import os
import sys
from typing import Final

import grpc
from grpc_health.v1.health_pb2 import HealthCheckRequest, HealthCheckResponse

_METHOD: Final = "/grpc.health.v1.Health/Check"
_ANSWER_WITHIN_S: Final = 3.0


def state_of(target: str, service: str = "") -> str:
    """Returns the serving status by name, or "CODE: details" of the gRPC error.

    Args:
        target: "HOST:PORT" or "unix:PATH".
        service: full name of a service, or another name that the server reports a status for.
    """
    with grpc.insecure_channel(target) as channel:
        check = channel.unary_unary(
            _METHOD, HealthCheckRequest.SerializeToString, HealthCheckResponse.FromString
        )
        try:
            answer = check(HealthCheckRequest(service=service), timeout=_ANSWER_WITHIN_S)
        except grpc.RpcError as error:
            return f"{error.code().name}: {error.details()}"
    return HealthCheckResponse.ServingStatus.Name(answer.status)


def main() -> None:
    """Runs the check and exits."""
    target = sys.argv[1] if len(sys.argv) > 1 else os.environ.get("HEALTH_TARGET", "")
    if not target:
        raise SystemExit("error: no target. Name one, 127.0.0.1:50051 for example, or set HEALTH_TARGET")
    state = state_of(target, sys.argv[2] if len(sys.argv) > 2 else "")
    print(f"{target}: {state}")
    raise SystemExit(0 if state == "SERVING" else 1)


if __name__ == "__main__":
    main()
