"""One id per request: in every log line that it causes, in both containers, and in what a caller may quote.

A caller may bring its own in the metadata. Most requests cause no log line, so the id is made when somebody
asks for it first.
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
"""Anything else might be made to look like a log line of its own."""
_NEW_BYTES: Final = 8


class Call(Protocol):
    """What is needed of gRPC's context."""

    def invocation_metadata(self) -> Any:
        """Pairs of key and value, or None."""


class _Request:
    __slots__ = ("_call", "_id")

    def __init__(self, call: Call | None, known: str = "") -> None:
        self._call = call
        self._id = known

    def id(self) -> str:
        if not self._id:
            self._id = _brought(self._call) or secrets.token_hex(_NEW_BYTES)
        return self._id


_request: ContextVar[_Request | None] = ContextVar("request", default=None)


def begin(call: Call) -> None:
    """The task that runs now serves this call, until it ends."""
    _request.set(_Request(call))


def current() -> str:
    """The id of the request that is served, empty when none is."""
    request = _request.get()
    return request.id() if request else ""


@contextmanager
def continuing(request_id: str) -> Iterator[None]:
    """What is done in the block is done for this request; with an empty id, for none."""
    token = _request.set(_Request(None, request_id) if request_id else None)
    try:
        yield
    finally:
        _request.reset(token)


def _brought(call: Call | None) -> str:
    for key, value in (call.invocation_metadata() or ()) if call else ():
        if key == HEADER and isinstance(value, str) and _FIT_TO_LOG.fullmatch(value):
            return value
    return ""
