"""Time zones of the tests' own, so that what is known of them does not depend on the machine."""

import struct
import sys
import time
import zoneinfo
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import pytest

RULES: Final = {
    "UTC": "UTC0",
    "America/New_York": "EST5EDT,M3.2.0,M11.1.0",
    "Asia/Tokyo": "JST-9",
    "Europe/Berlin": "CET-1CEST,M3.5.0,M10.5.0/3",
}
"""By name, in the form of POSIX: offset from UTC with the opposite sign, begin and end of summer time."""
_HEADER: Final = struct.Struct(">4sc15x6L")
_TYPE: Final = struct.Struct(">lBB")
_ABBREVIATION: Final = b"LMT\0"


def zone_files(directory: Path) -> Path:
    """Writes a file for each of the zones; returns the directory."""
    for name, rule in RULES.items():
        path = directory / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(_zone_file(rule))
    return directory


@contextmanager
def known_zones(directory: Path) -> Iterator[None]:
    """Has this process know the zones of a directory and no others, within the block."""
    before = zoneinfo.TZPATH
    with pytest.MonkeyPatch.context() as changed:
        # Where it is installed, Python takes from it what the directories do not have.
        changed.setitem(sys.modules, "tzdata", None)
        try:
            _look_in(directory)
            yield
        finally:
            _look_in(*before)


@contextmanager
def local_zone(rule: str) -> Iterator[None]:
    """Has this process be in a zone, in the form of POSIX, within the block."""
    try:
        with pytest.MonkeyPatch.context() as changed:
            changed.setenv("TZ", rule)
            time.tzset()
            yield
    finally:
        time.tzset()


def _look_in(*directories: Path | str) -> None:
    zoneinfo.reset_tzpath(directories)
    zoneinfo.ZoneInfo.clear_cache()


def _zone_file(rule: str) -> bytes:
    """A file as RFC 8536 has it, of version 2 and without a history: its rule holds at all times."""
    header = _HEADER.pack(b"TZif", b"2", 0, 0, 0, 0, 1, len(_ABBREVIATION))
    # Both blocks alike: they differ in the size of their transitions, of which there are none.
    block = header + _TYPE.pack(0, 0, 0) + _ABBREVIATION
    return block + block + f"\n{rule}\n".encode()
