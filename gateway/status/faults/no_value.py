"""The fault of a generic value whose messages arrive without it."""

from collections.abc import Iterator

from gateway.status.fault import Condition, Severity
from gateway.status.source_view import SourceView


def no_value_fault(source: SourceView, what: str, cause: str) -> Iterator[Condition]:
    """Yields the condition of a fresh message without a value.

    Args:
        source: of the message.
        what: what the message lacks, "a number" for example.
        cause: what its publisher does.
    """
    if source.freshness.fresh:
        name = source.spec.display_name
        yield Condition(
            f"{source.spec.name}.no_value",
            Severity.ERROR if source.required else Severity.WARNING,
            name,
            f"{name} arrives without {what}: it is unknown, and can't be judged",
            f"Check its sensor and the program that publishes it: {cause}",
        )
