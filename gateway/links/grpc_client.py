"""What clients of services on gRPC share: the channel over a Unix socket, and its errors."""

import asyncio
from pathlib import Path
from typing import Final

import grpc

from common import request_id
from gateway.links.link import RefusedError
from gateway.links.watch import ABSENT, LinkLostError

_OPTIONS: Final = (
    # A new attempt is a new connection; gRPC's own backoff (1 s to 120 s), which it shares between the
    # channels of a process, must not add to the link's.
    ("grpc.use_local_subchannel_pool", 1),
    ("grpc.enable_retries", 0),
)
_MAX_MESSAGE_BYTES: Final = 256 * 1024
GONE: Final = frozenset(
    {grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.DEADLINE_EXCEEDED, grpc.StatusCode.CANCELLED}
)
"""The codes of a service that does not answer."""
_CALLER: Final = "x-caller"
"""Metadata: who calls, for people."""


def unix_channel(
    socket: Path, max_message_bytes: int = _MAX_MESSAGE_BYTES, *, ahead_bytes: int | None = None
) -> grpc.aio.Channel:
    """Returns a channel that closes with its `async with` block.

    Args:
        socket: where the service listens, or will.
        max_message_bytes: a longer response fails.
        ahead_bytes: what each stream may receive before it is read (flow-control window, RFC 9113 5.2); None
            for gRPC's default, 64 KiB.
    """
    ahead = () if ahead_bytes is None else (("grpc.http2.lookahead_bytes", ahead_bytes),)
    options = (*_OPTIONS, ("grpc.max_receive_message_length", max_message_bytes), *ahead)
    return grpc.aio.insecure_channel(f"unix:{socket}", options=options)


def lost(error: grpc.aio.AioRpcError) -> LinkLostError:
    """Returns the error of a broken stream of reports."""
    detail = f"{error.code().name} {error.details()}"
    return LinkLostError(ABSENT if error.code() in GONE else detail, detail)


def failed(error: grpc.aio.AioRpcError) -> LinkLostError | RefusedError:
    """Returns the error of a request that failed: a refusal, unless the service is gone."""
    return lost(error) if error.code() in GONE else RefusedError(error.details() or error.code().name)


def call_metadata(caller: str) -> tuple[tuple[str, str], ...]:
    """Returns the metadata of an operator's call that is passed on: its request ID, and who calls."""
    return (request_id.HEADER, request_id.current()), (_CALLER, caller)


def is_cancelled() -> bool:
    """Whether this task is cancelled: gRPC raises the same when the link closes the channel under a call."""
    task = asyncio.current_task()
    return bool(task and task.cancelling())
