"""What operators are told when a fault begins, grows worse or ends."""

from collections.abc import Iterator

from gateway.status.faults.book import Changes
from gateway.status.faults.fault import Fault


def sentences(changes: Changes) -> Iterator[str]:
    """One sentence per change, the worst first."""
    for fault in changes.raised:
        yield f"{_word(fault)}: {fault.condition.message}"
    for fault in changes.worsened:
        yield f"{_word(fault)} now: {fault.condition.message}"
    for fault in changes.cleared:
        yield f"over: {fault.condition.message}"


def _word(fault: Fault) -> str:
    return fault.condition.severity.value
