"""The readers by message type and source."""

from collections.abc import Callable
from typing import Any, TypeVar

from common.errors import ExitCode, UserError
from gateway.config import SourceSettings
from gateway.status.sources import SourceSpec, ValueT

Reader = Callable[[Any, SourceSettings], ValueT | None]
"""Converts a message into a value; None if the message holds nothing usable."""
_ReaderT = TypeVar("_ReaderT", bound=Callable[..., Any])

_readers: dict[tuple[str, SourceSpec[Any]], Reader[Any]] = {}
_of_any_type: dict[str, Reader[Any]] = {}
"""By generic kind."""
_headers_and_lists: set[str] = set()


def reads(
    message_type: str, *specs: SourceSpec[Any], header_and_list: bool = False
) -> Callable[[_ReaderT], _ReaderT]:
    """Registers the decorated function for a message type and the sources that may have it.

    Args:
        message_type: package/msg/Name.
        specs: the sources; their value type is what the function returns.
        header_and_list: whether the message consists of a std_msgs/Header and one list; such lists are
            truncated before deserialisation.
    """

    def register(reader: _ReaderT) -> _ReaderT:
        for spec in specs:
            if (message_type, spec) in _readers:
                raise ValueError(f"two readers for {message_type} as {spec.kind}")
            _readers[message_type, spec] = reader
        if header_and_list:
            _headers_and_lists.add(message_type)
        return reader

    return register


def reads_any_type(spec: SourceSpec[Any]) -> Callable[[_ReaderT], _ReaderT]:
    """Registers the decorated function for all sources of a generic kind, whatever their message type."""

    def register(reader: _ReaderT) -> _ReaderT:
        _of_any_type[spec.kind] = reader
        return reader

    return register


def reader_for(source: SourceSettings) -> Reader[Any]:
    """Returns the reader of a configured source.

    Raises:
        UserError: the type has no reader; the line names the types that have one.
    """
    reader = _of_any_type.get(source.kind) or _readers.get((source.type, source.spec))
    if reader is None:
        raise UserError(
            f"source '{source.name}' ({source.topic}) has type {source.type}, which no reader supports",
            f"Use one of {', '.join(types_of(source.spec))}, or add a reader (docs/adding-a-source.md)",
            exit_code=ExitCode.USAGE,
        )
    return reader


def types_of(spec: SourceSpec[Any]) -> list[str]:
    """Returns the message types that a source can be read from, sorted."""
    return sorted(message_type for message_type, registered in _readers if registered is spec)


def is_header_and_list(source: SourceSettings) -> bool:
    """Returns whether the source's messages consist of a header and one list."""
    return source.type in _headers_and_lists
