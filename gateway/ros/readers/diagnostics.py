"""diagnostic_msgs/msg/DiagnosticArray: what some of the robot's components say of themselves."""

from typing import Any, Final

from gateway.config import SourceSettings
from gateway.ros.readers.plain import name
from gateway.ros.readers.registry import reads
from gateway.status.board import SourceKind
from gateway.status.diagnostics import COMPONENTS_KEPT
from gateway.status.values import DiagnosticItem, DiagnosticLevel, Diagnostics

# By the numbers of the message: OK, WARN, ERROR, STALE.
_LEVELS: Final = (DiagnosticLevel.OK, DiagnosticLevel.WARNING, DiagnosticLevel.ERROR, DiagnosticLevel.STALE)
_MESSAGE_LENGTH: Final = 300


@reads("diagnostic_msgs/msg/DiagnosticArray", SourceKind.DIAGNOSTICS, header_and_list=True)
def from_diagnostic_array(message: Any, source: SourceSettings) -> Diagnostics:
    """The components that this message names; the key-value pairs are left to the robot's own tools."""
    return Diagnostics(tuple(_item(status) for status in message.status[:COMPONENTS_KEPT]))


def _item(status: Any) -> DiagnosticItem:
    return DiagnosticItem(
        component=name(status.name), level=_level(status.level), message=name(status.message, _MESSAGE_LENGTH)
    )


def _level(level: bytes) -> DiagnosticLevel:
    """The level, one byte. A number that the message does not define counts as an error, not as well."""
    number = int.from_bytes(level, "little")
    return _LEVELS[number] if number < len(_LEVELS) else DiagnosticLevel.ERROR
