"""Names and paths of recordings, and writing that survives a power loss.

No path comes from a request: a recording is looked up by its ID in the catalogue, a file by its name in
the manifest. What the patterns here do not match, in the folder or in a request, is not ours.
"""

import os
import re
import secrets
import tempfile
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import Final

from common import private_files
from recorder.mcap.records import PART

ID: Final = re.compile(r"\d{8}T\d{6}Z-[0-9a-f]{6}")
"""Of recordings that the recorder makes: the start by the calendar clock in UTC, and a random part."""
RECORDINGS: Final = "recordings"
DATA: Final = "data"
SEGMENT_FILE: Final = re.compile(r"(?:\d{6}|[1-9]\d{6,8})\.mcap")
"""Six digits, from the millionth on as many as it takes."""
SEGMENT: Final = re.compile(f"{DATA}/{SEGMENT_FILE.pattern}")
"""A segment's name in a recording's folder."""
MANIFEST: Final = "manifest.json"
DAMAGED: Final = ".damaged"
"""Suffix of a file that can't be used and is kept aside; of several of one name, a number follows."""
DAMAGED_MANIFEST: Final = f"{MANIFEST}{DAMAGED}"
METADATA: Final = f"{DATA}/metadata.yaml"
"""rosbag2's file, beside the segments: some readers look for them nowhere else."""
COPY: Final = ".copy"
"""Suffix of a segment that is being copied because it can't be linked; its name begins with a dot."""
_TEMPORARY: Final = re.compile(
    rf"\.{SEGMENT_FILE.pattern}{re.escape(COPY)}"
    r"|\.(?:manifest\.json|metadata\.yaml|state\.json)\.[a-z0-9_]{8}"
)
"""Names of files that get their own name when they are complete: here, and those of tempfile.mkstemp."""

_FILE_MODE: Final = 0o640
_DIRECTORY_MODE: Final = 0o750


def new_id(unix_s: float) -> str:
    """Returns an ID that was never used: IDs of the same second differ in 24 random bits."""
    return f"{datetime.fromtimestamp(unix_s, UTC):%Y%m%dT%H%M%SZ}-{secrets.token_hex(3)}"


def segment_name(number: int) -> str:
    """Returns the name of a recording's segment, counted from 0."""
    return f"{DATA}/{number:06d}.mcap"


def segment_number(name: str) -> int:
    """Returns which segment of its recording has this name."""
    return int(Path(name).stem)


def files_named(directory: Path, name: re.Pattern[str], suffix: str = "") -> list[Path]:
    """Returns the files of a directory whose names, before the suffix, match; by number, without links.

    Raises:
        OSError: the directory can't be read.
    """
    found = [
        path
        for path in directory.iterdir()
        if path.name.endswith(suffix)
        and name.fullmatch(path.name.removesuffix(suffix))
        and path.is_file()
        and not path.is_symlink()
    ]
    # Of numbers with as many digits as they need at least, the longer name is the greater one.
    return sorted(found, key=lambda path: (len(path.name), path.name))


def is_temporary(path: Path) -> bool:
    """Returns whether a file is one that `replace_file`, or a copy, had not completed."""
    return bool(_TEMPORARY.fullmatch(path.name)) and (path.is_symlink() or not path.is_dir())


def clear_temporaries(directory: Path) -> None:
    """Deletes what a process that was killed while it wrote has left. Only while no other one writes there.

    Raises:
        OSError: the disk fails.
    """
    for path in [each for each in directory.iterdir() if is_temporary(each)]:
        path.unlink(missing_ok=True)


def put_aside(path: Path) -> Path:
    """Renames "NAME" or "NAME.part" to "NAME.damaged", or the like if that exists, and returns the new path.

    Raises:
        OSError: the disk fails.
    """
    aside = wanted = path.with_name(path.name.removesuffix(PART) + DAMAGED)
    numbers = count(1)
    while aside.exists():
        aside = wanted.with_name(f"{wanted.name}.{next(numbers)}")
    path.rename(aside)
    private_files.sync_directory(path.parent)
    return aside


def make_directory(directory: Path) -> None:
    """Makes a directory and its missing parents, readable by the group.

    Raises:
        OSError: it can't be made.
    """
    private_files.make_directory(directory, _DIRECTORY_MODE)


def replace_file(path: Path, content: bytes) -> None:
    """Replaces a file atomically (rename(2)); afterwards it survives a power loss.

    Raises:
        OSError: the disk is full or fails. The file is as it was.
    """
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    temporary = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fchmod(file.fileno(), _FILE_MODE)
            os.fsync(file.fileno())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
    private_files.sync_directory(path.parent)
