"""What operators are told when a fault begins, grows worse or ends."""

from collections.abc import Iterator

from gateway.status.event import FaultCleared, FaultRaised, News
from gateway.status.faults.book import Changes
from gateway.status.faults.fault import Fault, Severity


def fault_news(changes: Changes) -> Iterator[News]:
    """One piece of news per change, the worst first."""
    for fault in changes.raised:
        yield _raised(fault, f"{_word(fault)}: {fault.condition.message}")
    for fault in changes.worsened:
        yield _raised(fault, f"{_word(fault)} now: {fault.condition.message}")
    for fault in changes.cleared:
        sentence = f"over: {fault.condition.message}"
        yield News(Severity.INFO, fault.condition.component, sentence, FaultCleared(fault), sentence)


def _raised(fault: Fault, sentence: str) -> News:
    condition = fault.condition
    return News(condition.severity, condition.component, condition.message, FaultRaised(fault), sentence)


def _word(fault: Fault) -> str:
    return fault.condition.severity.value
