"""Faults of the robot's sources: what should come and does not."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from gateway.status.board import SourceKind
from gateway.status.faults.fault import Condition, Severity
from gateway.status.sources import SourceState, SourceView


@dataclass(frozen=True, slots=True)
class _Trouble:
    """What a state of a source is as a fault; the sentence is the source's own."""

    suffix: str
    remedy: str


TROUBLES: Final[Mapping[SourceState, _Trouble | None]] = {
    SourceState.RECEIVING: None,
    SourceState.WAITING: _Trouble(
        "missing", "Start the program that makes it; check that it runs in the gateway's ROS domain"
    ),
    SourceState.SILENT: _Trouble(
        "silent", "Look at the program that makes it: it is there and does not send"
    ),
    SourceState.STALE: _Trouble("stale", "Look at the program that makes it, and at the load of the robot"),
    SourceState.QOS_MISMATCH: _Trouble(
        "qos_mismatch", "Change reliability or durability of this source in the gateway's configuration"
    ),
    SourceState.WRONG_TYPE: _Trouble(
        "wrong_type", "Correct the type of this source in the gateway's configuration"
    ),
    SourceState.TYPE_MISSING: _Trouble("type_missing", "Type on the robot: robot-gateway doctor"),
}
"""Total: every state of a source, and what fault it is."""

_NEED_TIME: Final = frozenset({SourceState.WAITING, SourceState.SILENT})
"""States in which every source begins."""
_MAY_BE_QUIET: Final = frozenset({SourceKind.MODE, SourceKind.EFFECTIVE_COMMAND, SourceKind.MUX_INPUT})
"""Sources that speak only when there is something to say."""


def source_faults(sources: tuple[SourceView, ...], *, settled: bool) -> Iterator[Condition]:
    """What is wrong now.

    Args:
        sources: every configured source.
        settled: whether the gateway has run long enough for every source to have come.
    """
    for source in sources:
        trouble = TROUBLES[source.state]
        if trouble and _counts(source, settled=settled):
            yield Condition(
                f"{source.name}.{trouble.suffix}",
                Severity.ERROR if source.required else Severity.WARNING,
                source.words,
                source.detail,
                trouble.remedy,
            )


def _counts(source: SourceView, *, settled: bool) -> bool:
    if source.state in _NEED_TIME and not settled:
        return False
    if source.state is SourceState.WAITING:
        # Not every robot has everything that the configuration knows.
        return source.required
    if source.state in {SourceState.SILENT, SourceState.STALE}:
        return source.required or source.kind not in _MAY_BE_QUIET
    return True
