"""Looks at a running bridge from outside."""

from pathlib import Path
from typing import Any, Final

import grpc

from omniseer.bridge.v1 import bridge_service_pb2 as pb
from omniseer.bridge.v1 import bridge_service_pb2_grpc as pb_grpc

_TIMEOUT_S: Final = 3.0


def newest_state(socket: Path) -> pb.WatchStateResponse:
    """Returns the state of the bridge at this socket.

    Raises:
        grpc.RpcError: none answers.
    """
    with grpc.insecure_channel(f"unix:{socket}") as channel:
        stub: Any = pb_grpc.BridgeServiceStub(channel)
        states = stub.WatchState(pb.WatchStateRequest(), timeout=_TIMEOUT_S)
        state: pb.WatchStateResponse = next(states)
        states.cancel()
    return state
