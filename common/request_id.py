"""The id of the current request: in its log lines in both containers, and in error reports of callers.

A caller may send its own id in the metadata. Otherwise one is generated on first use, because most requests
write no log line.

What a call has started, a timer or a task, may write a line after the call has ended. gRPC frees the
metadata of a call with its end, so that they are read at its beginning, or never.
"""

import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Final, Protocol

HEADER: Final = "x-request-id"
"""The metadata key."""
_FIT_TO_LOG: Final = re.compile(r"[A-Za-z0-9._:-]{1,64}")
"""Rejects ids that could forge log lines."""
_NEW_BYTES: Final = 8


class HasMetadata(Protocol):
    """The part of grpc.ServicerContext that is used."""

    def invocation_metadata(self) -> Any:
        """Returns pairs of key and value, or None."""


class _Request:
    __slots__ = ("_id",)

    def __init__(self, known: str) -> None:
        self._id = known

    def id(self) -> str:
        if not self._id:
            self._id = secrets.token_hex(_NEW_BYTES)
        return self._id


_request: ContextVar[_Request | None] = ContextVar("request", default=None)


def begin(call: HasMetadata) -> None:
    """Associates the current task with this call, until the task ends."""
    _request.set(_Request(_sent_by(call)))


def current() -> str:
    """Returns the id of the current request; empty outside of requests."""
    request = _request.get()
    return request.id() if request else ""


@contextmanager
def continuing(request_id: str) -> Iterator[None]:
    """Runs the block on behalf of the given request; of none if the id is empty."""
    token = _request.set(_Request(request_id) if request_id else None)
    try:
        yield
    finally:
        _request.reset(token)


def _sent_by(call: HasMetadata) -> str:
    for key, value in call.invocation_metadata() or ():
        if key == HEADER and isinstance(value, str) and _FIT_TO_LOG.fullmatch(value):
            return value
    return ""
