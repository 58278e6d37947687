"""Names of time zones in a configuration, as the IANA's database has them on this machine."""

from difflib import get_close_matches
from typing import Final
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError, available_timezones

_EXPECTED: Final = "an IANA time zone, Europe/Berlin for example"


def checked_name(name: str) -> str:
    """Returns the name of a zone that this machine knows.

    Raises:
        ValueError: it knows none of that name; the text says what is expected, for people.
    """
    try:
        ZoneInfo(name)
    # OSError: the name of a folder of zones, Europe for example, which Python looks for as a file.
    except (ZoneInfoNotFoundError, ValueError, OSError):
        raise ValueError(f"{_EXPECTED}; {_hint(name)}".removesuffix("; ")) from None
    return name


def _hint(name: str) -> str:
    known = {each.lower(): each for each in sorted(available_timezones())}
    if not known:
        return "this machine knows none, type: sudo apt-get install tzdata"
    meant = get_close_matches(name.lower(), known, n=1)
    return f"did you mean {known[meant[0]]}?" if meant else ""
