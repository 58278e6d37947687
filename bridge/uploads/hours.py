"""The hours of uploads: times of the day as the clock on the wall shows them in one time zone.

| what happens | what follows |
|---|---|
| hours last over midnight | they are open from the evening to the morning |
| summer time begins, and an hour is skipped | what begins in it begins at its end, if it lasts longer |
| summer time ends, and an hour occurs twice | hours within it are open twice |
| no zone is set | that of this machine counts; of a container, which has none, UTC |
"""

from collections.abc import Iterator
from datetime import datetime
from typing import Final

from bridge.config import UploadSettings

DOUBT: Final = (
    "uploads.time_zone is not set, and this machine or container has no zone but UTC: "
    "recordings may be uploaded at other hours of the robot's day"
)
"""Why the hours may not be those that were meant."""
REMEDY: Final = (
    "Set uploads.time_zone to the robot's zone, Europe/Berlin for example, or to UTC if that is meant"
)


def are_open(settings: UploadSettings, now: datetime) -> bool:
    """Returns whether an instant is within the hours; without any, each is."""
    shown = f"{now.astimezone(settings.zone):%H:%M}"
    return not settings.hours or any(_is_within(hours, shown) for hours in settings.hours)


def in_words(settings: UploadSettings, now: datetime) -> str:
    """Returns the time by the clock of the hours, its zone and the hours, for people; empty without any."""
    if not settings.hours:
        return ""
    shown = now.astimezone(settings.zone)
    zone = settings.time_zone or f"{shown:%Z}"
    return f"it is {shown:%H:%M} ({zone}); uploads are allowed at {', '.join(settings.hours)}"


def are_doubtful(settings: UploadSettings, now: datetime) -> bool:
    """Returns whether the hours are by UTC although the settings do not ask for it."""
    return bool(settings.hours) and settings.time_zone is None and f"{now.astimezone():%Z}" == "UTC"


def sentences(settings: UploadSettings, now: datetime) -> Iterator[str]:
    """Yields the clock that the hours are by, and what makes it doubtful; nothing without hours."""
    if settings.hours:
        yield f"uploads.hours: {in_words(settings, now)}"
    if are_doubtful(settings, now):
        yield f"uploads.hours: {DOUBT}. {REMEDY}"


def _is_within(hours: str, shown: str) -> bool:
    """Returns whether "HH:MM" is within "HH:MM-HH:MM", which may last over midnight; the end is not."""
    begin, _, end = hours.partition("-")
    return begin <= shown < end if begin < end else shown >= begin or shown < end
