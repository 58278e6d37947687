"""What a call was refused with, as its caller sees it."""

from typing import Any

import grpc
import pytest

from common.refusal import refusal_in


def reason_of(error: grpc.aio.AioRpcError) -> tuple[grpc.StatusCode, str]:
    """The code and the reason that a call ended with."""
    return error.code(), refusal_in(error.trailing_metadata()).reason


async def refused(call: Any) -> tuple[grpc.StatusCode, str]:
    """The code and the reason that a call is refused with; one that is not refused fails the test."""
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await call
    return reason_of(caught.value)
