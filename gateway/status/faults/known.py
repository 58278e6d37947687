"""Which faults a gateway can have, to find rules for faults that match none. Pure."""

from collections.abc import Collection, Iterator
from typing import Any, Final

from gateway.status.faults import cloud, driving, preview, recording
from gateway.status.faults.sources import STATE_FAULTS
from gateway.status.faults.tracker import CAPPED
from gateway.status.meaning import NumberMeaning, Side, TextMeaning
from gateway.status.sources import BATTERY, DIAGNOSTICS, ORIENTATION, POSITION, SourceSpec

ANY_WORD: Final = "*"
"""Stands for one part of an ID that the robot chooses."""
_WITHOUT_SOURCES: Final = (
    *(f"access.{name}" for name in ("audit", "authority", "credentials", "server_certificate")),
    cloud.SERVICE,
    cloud.OFFLINE,
    cloud.REFUSED,
    cloud.OUTBOX,
    cloud.UPLOAD,
    driving.UNREACHABLE,
    driving.STOPPED,
    driving.BASE,
    *(
        f"platform.{name}"
        for name in ("battery_low", "disk", "memory", "stale", "temperature", "throttled", "wifi")
    ),
    preview.UNREACHABLE,
    preview.FAULTED,
    preview.FALLBACK,
    f"{preview.CAMERA}{ANY_WORD}",
    recording.SERVICE,
    recording.DISK,
    recording.LOSING,
    CAPPED,
    "ros.stalled",
)
"""Also of programs that the configuration does not name: it may name them tomorrow."""
_OF_KIND: Final = {
    BATTERY.kind: ("battery.low", "battery.out_of_range"),
    DIAGNOSTICS.kind: (f"diagnostics.{ANY_WORD}",),
    ORIENTATION.kind: ("orientation.tilt",),
    POSITION.kind: ("position.no_fix",),
}


def known_faults(sources: Collection[SourceSpec[Any]]) -> Iterator[str]:
    """Yields the IDs of all faults that a gateway with these sources can have."""
    yield from _WITHOUT_SOURCES
    for spec in sources:
        yield from _OF_KIND.get(spec.kind, ())
        yield from (f"{spec.name}.{fault[0]}" for fault in STATE_FAULTS.values() if fault)
        match spec.meaning:
            case NumberMeaning():
                yield from (f"{spec.name}.{word}" for word in (*(side.value for side in Side), "no_value"))
            case TextMeaning():
                yield from (f"{spec.name}.value.{ANY_WORD}", f"{spec.name}.no_value")


def matches(rule: str, fault_id: str) -> bool:
    """Returns whether a rule is the ID of a known fault, or its beginning up to a dot."""
    words, known = rule.split("."), fault_id.split(".")
    beginning = known[: len(words)]
    return len(words) == len(beginning) and all(
        one in (ANY_WORD, word) for one, word in zip(beginning, words, strict=True)
    )
