"""When recordings may be uploaded: pure functions that return why not, in words for people."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from fnmatch import fnmatchcase
from typing import Final

from bridge.config import UploadSettings
from bridge.uploads import hours


@dataclass(frozen=True, slots=True)
class Conditions:
    """What the gates depend on, at one instant.

    Attributes:
        interface: Through which the store is reached. Empty: not known, or not needed.
        now: The instant, aware of its zone, which may be any.
        charging: Whether the main battery is being charged; None if unknown.
    """

    interface: str
    now: datetime
    charging: bool | None


def closed(settings: UploadSettings, conditions: Conditions) -> str:
    """Returns why no recording may be uploaded now; empty if it may."""
    return next(filter(None, (gate(settings, conditions) for gate in _GATES)), "")


def wrong_interface(settings: UploadSettings, name: str) -> str:
    """Returns why nothing may be sent through an interface; empty if it may.

    Args:
        settings: Which ones are allowed.
        name: Of the interface; empty if it is not known.
    """
    allowed = settings.interfaces
    if not allowed or any(fnmatchcase(name, pattern) for pattern in allowed):
        return ""
    through = f"the store is reached through {name}" if name else "the route to the store is not known"
    return f"{through}; uploads are allowed through {', '.join(allowed)}"


def _interface(settings: UploadSettings, conditions: Conditions) -> str:
    return wrong_interface(settings, conditions.interface)


def _hours(settings: UploadSettings, conditions: Conditions) -> str:
    return "" if hours.are_open(settings, conditions.now) else hours.in_words(settings, conditions.now)


def _charging(settings: UploadSettings, conditions: Conditions) -> str:
    if not settings.only_while_charging or conditions.charging:
        return ""
    if conditions.charging is None:
        return "it is not known whether the robot is charging; uploads are allowed only while it is"
    return "the robot is not charging; uploads are allowed only while it is"


_GATES: Final[tuple[Callable[[UploadSettings, Conditions], str], ...]] = (_interface, _hours, _charging)
