"""Asks a server of ours whether it serves, for the containers' health checks: ends 0 (yes) or 1 (no).

`python -m common.healthcheck [TARGET [SERVICE]]`; without a target the environment's HEALTH_TARGET counts,
without a service the server as a whole.
"""

import os
import sys
from typing import Final

import grpc
from grpc_health.v1.health_pb2 import HealthCheckRequest, HealthCheckResponse

_METHOD: Final = "/grpc.health.v1.Health/Check"
_ANSWER_WITHIN_S: Final = 3.0


def state_of(target: str, service: str = "") -> str:
    """SERVING, NOT_SERVING, SERVICE_UNKNOWN, or why there is no answer.

    Args:
        target: "HOST:PORT" or "unix:PATH".
        service: its full name, or a name the server made up for a part of it.
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
    """The program."""
    target = sys.argv[1] if len(sys.argv) > 1 else os.environ.get("HEALTH_TARGET", "")
    if not target:
        raise SystemExit("error: no target. Name one, 127.0.0.1:50051 for example, or set HEALTH_TARGET")
    state = state_of(target, sys.argv[2] if len(sys.argv) > 2 else "")
    print(f"{target}: {state}")
    raise SystemExit(0 if state == "SERVING" else 1)


if __name__ == "__main__":
    main()
