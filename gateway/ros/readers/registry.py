"""Which function reads which message type."""

from collections.abc import Callable
from typing import Any, TypeVar

from common.errors import ExitCode, UserError
from gateway.config import SourceSettings
from gateway.status.board import SourceKind
from gateway.status.values import Battery, Detections, Diagnostics, Mode, Odometry, Velocity, Vision

Value = Odometry | Vision | Detections | Battery | Diagnostics | Mode | Velocity
Reader = Callable[[Any, SourceSettings], Value | None]
"""Turns a message into a value; None when the message holds nothing that can be used."""
_ReaderT = TypeVar("_ReaderT", bound=Reader)

_readers: dict[tuple[str, SourceKind], Reader] = {}
_headers_and_lists: set[str] = set()


def reads(
    message_type: str, kind: SourceKind, *, header_and_list: bool = False
) -> Callable[[_ReaderT], _ReaderT]:
    """Registers the decorated function for a message type ("nav_msgs/msg/Odometry") and what it tells.

    Args:
        message_type: package/msg/Name.
        kind: what it tells.
        header_and_list: whether the message is a std_msgs/Header, one list and nothing else; such lists are
            cut to what is wanted before they are decoded.
    """

    def register(reader: _ReaderT) -> _ReaderT:
        if (message_type, kind) in _readers:
            raise ValueError(f"two readers for {message_type} as {kind.value}")
        _readers[message_type, kind] = reader
        if header_and_list:
            _headers_and_lists.add(message_type)
        return reader

    return register


def reader_for(source: SourceSettings) -> Reader:
    """The reader of a configured source.

    Raises:
        UserError: no reader is known for this type; the line names those that are.
    """
    reader = _readers.get((source.type, source.kind))
    if reader is None:
        known = sorted(name for name, kind in _readers if kind is source.kind)
        raise UserError(
            f"source '{source.name}' ({source.topic}) has type {source.type}, which no reader knows",
            f"Use one of {', '.join(known)}, or add a reader (gateway/ros/readers)",
            exit_code=ExitCode.USAGE,
        )
    return reader


def is_header_and_list(source: SourceSettings) -> bool:
    """Whether the source's messages are a header, one list and nothing else."""
    return source.type in _headers_and_lists
