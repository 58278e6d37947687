"""Faults of the sources: expected and not received."""

from collections.abc import Iterator, Mapping
from typing import Final

from common.start_command import messages_remedy
from gateway.status.fault import Condition, Severity
from gateway.status.source_view import SourceState, SourceView

STATE_FAULTS: Final[Mapping[SourceState, tuple[str, str] | None]] = {
    SourceState.RECEIVING: None,
    SourceState.WAITING: (
        "missing",
        "Start the program that publishes it; check that it runs in the gateway's ROS domain",
    ),
    SourceState.SILENT: ("silent", "Check the program that publishes it: it is running but sends nothing"),
    SourceState.STALE: ("stale", "Check the program that publishes it, and the load of the robot"),
    SourceState.QOS_MISMATCH: (
        "qos_mismatch",
        "Change reliability or durability of this source in the gateway's configuration",
    ),
    SourceState.WRONG_TYPE: ("wrong_type", "Correct the type of this source in the gateway's configuration"),
    SourceState.TYPE_MISSING: ("type_missing", "Type on the robot: robot-gateway doctor"),
    SourceState.FIELD_MISSING: ("field_missing", "Type on the robot: robot-gateway doctor"),
    SourceState.UNDECODABLE: (
        "undecodable",
        f"Give the gateway the robot's version of this message package. {messages_remedy()}",
    ),
}
"""Total: suffix of the fault id, and remedy; None for the state that is no fault. The message is the source's
own detail."""

_STARTUP_STATES: Final = frozenset({SourceState.WAITING, SourceState.SILENT})
"""States in which every source begins."""


def sampler_fault() -> Condition:
    """Returns the condition of a gateway that does not read ROS: the robot's programs are not to blame."""
    return Condition(
        "ros.stalled",
        Severity.ERROR,
        "gateway",
        "the gateway does not read ROS at the moment; the values shown are old",
        "If it stays, restart the gateway; its log, and the load of the robot, show why",
    )


def source_faults(sources: tuple[SourceView, ...], *, settled: bool) -> Iterator[Condition]:
    """Yields the conditions of the configured sources.

    Args:
        sources: every configured source.
        settled: whether the startup grace has elapsed.
    """
    for source in sources:
        fault = STATE_FAULTS[source.state]
        if fault and _is_fault(source, settled=settled):
            suffix, remedy = fault
            yield Condition(
                f"{source.spec.name}.{suffix}",
                Severity.ERROR if source.required else Severity.WARNING,
                source.spec.display_name,
                source.detail,
                remedy,
            )


def _is_fault(source: SourceView, *, settled: bool) -> bool:
    if source.state in _STARTUP_STATES and not settled:
        return False
    if source.state is SourceState.WAITING:
        # Not every robot has all the sources that the default configuration lists.
        return source.required
    if source.state in {SourceState.SILENT, SourceState.STALE}:
        return not source.stale_since_pass and (source.required or not source.spec.quiet)
    return True
