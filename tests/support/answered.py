"""Questions to a program whose answer may come late."""

import time
from collections.abc import Callable
from typing import TypeVar

import grpc

T = TypeVar("T")


def answered(ask: Callable[[], T], within_s: float = 20.0) -> T:
    """Asks again when the call's deadline passes: a program on a busy machine may stand still for longer.

    Raises:
        grpc.RpcError: any other, as that of a program that does not run; or no answer for `within_s`.
    """
    end_s = time.monotonic() + within_s
    while True:
        try:
            return ask()
        except grpc.RpcError as error:
            if error.code() is not grpc.StatusCode.DEADLINE_EXCEEDED or time.monotonic() >= end_s:
                raise
