"""Values with their units, ages and sizes as text. "-" stands for an unknown value."""

from datetime import datetime, tzinfo
from typing import Final

from common import units

UNKNOWN: Final = "-"

_SECOND_MS: Final = 1000
_CLOCK_FORM: Final = "%Y-%m-%d %H:%M:%S %Z"
_MINUTE_S: Final = 60
_HOUR_S: Final = 3600
_GIB: Final = 1 << 30
_KILO: Final = 1000


def quantity(value: float | None, unit: str, digits: int = 1) -> str:
    """Returns a number and its unit: 29.8 fps."""
    return UNKNOWN if value is None else f"{value:.{digits}f} {unit}"


def signed(value: float | None, digits: int = 2) -> str:
    """Returns a number with its sign, for a direction: +0.50."""
    # Adding zero turns -0.0 into 0.0; a value that rounds to zero has no direction.
    return UNKNOWN if value is None else f"{round(value, digits) + 0.0:+.{digits}f}"


def age(age_ms: int | None) -> str:
    """Returns an age: 40 ms, 3.4 s, 2 min 05 s, 3 h 12 min."""
    if age_ms is None:
        return UNKNOWN
    if age_ms < _SECOND_MS:
        return f"{age_ms} ms"
    seconds = age_ms / _SECOND_MS
    if seconds < _MINUTE_S:
        return f"{seconds:.1f} s"
    if seconds < _HOUR_S:
        return f"{int(seconds // _MINUTE_S)} min {int(seconds % _MINUTE_S):02} s"
    return f"{int(seconds // _HOUR_S)} h {int(seconds % _HOUR_S // _MINUTE_S):02} min"


def wall_clock(unix_ms: int, zone: tzinfo | None = None, form: str = _CLOCK_FORM) -> str:
    """Returns a time since 1970 UTC in a time zone, or this computer's: 2026-11-21 23:59:59 UTC.

    One that the calendar does not have (a robot may send any number) is unknown.
    """
    try:
        return datetime.fromtimestamp(unix_ms / _SECOND_MS).astimezone(zone).strftime(form)
    except (ValueError, OverflowError, OSError):
        return UNKNOWN


def zone_text(time: datetime) -> str:
    """Returns the zone of a time by its offset: UTC+01:00."""
    offset = f"{time:%z}"
    return f"UTC{offset[:3]}:{offset[3:5]}"


def gibibytes(count: int | None) -> str:
    """Returns a size of memory: 1.2 GiB."""
    return quantity(None if count is None else count / _GIB, "GiB")


def size(count: int) -> str:
    """Returns a size of a file, in decimal units as disks and networks have them: 640 B, 12.3 MB, 4.1 GB."""
    value = float(count)
    for unit in ("B", "kB", "MB", "GB"):
        if value < _KILO:
            return f"{value:.0f} B" if unit == "B" else f"{value:.1f} {unit}"
        value /= _KILO
    return f"{value:.1f} TB"


def bit_rate(kbps: float | None) -> str:
    """Returns a bit rate: 850 kbit/s, 2.98 Mbit/s."""
    return UNKNOWN if kbps is None else units.bit_rate(kbps)


def plural(count: int | None, noun: str) -> str:
    """Returns a count and its noun: 1 viewer, 2 viewers."""
    if count is None:
        return f"{UNKNOWN} {noun}s"
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def sentence(words: str) -> str:
    """Returns words with a capital letter at their beginning; all others stay as they are."""
    return words[:1].upper() + words[1:]


def with_component(component: str, message: str) -> str:
    """Returns a message with its component before it, unless it names the component itself."""
    named = component.casefold() in message.casefold()
    return message if named else f"{component}: {message}"


def without_component(component: str, message: str) -> str:
    """Returns a message that stands beside its component: without that at its beginning, where it has it."""
    prefix = f"{component}:"
    named = component and message.casefold().startswith(prefix.casefold())
    return message[len(prefix) :].strip() if named else message


def joined(*parts: str) -> str:
    """Returns the parts that are not empty, separated by commas."""
    return ", ".join(part for part in parts if part)
