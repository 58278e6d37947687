"""Looks at a running recorder from outside."""

from pathlib import Path
from typing import Any, Final

import grpc

from omniseer.recorder.v1 import recorder_service_pb2 as recorder_pb
from omniseer.recorder.v1 import recorder_service_pb2_grpc as pb_grpc

_TIMEOUT_S: Final = 3.0


def newest_state(socket: Path) -> recorder_pb.WatchStateResponse:
    """Returns the state of the recorder at this socket.

    Raises:
        grpc.RpcError: none answers.
    """
    with grpc.insecure_channel(f"unix:{socket}") as channel:
        stub: Any = pb_grpc.RecorderServiceStub(channel)
        states = stub.WatchState(recorder_pb.WatchStateRequest(), timeout=_TIMEOUT_S)
        state: recorder_pb.WatchStateResponse = next(states)
        states.cancel()
    return state
