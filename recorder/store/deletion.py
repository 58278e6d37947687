"""Deleting a recording in two steps, so that a crash in between leaves none that is there by half.

It needs no room: a full disk is what it is for. The manifest's new name says that a deletion has begun.
"""

import re
from pathlib import Path
from typing import Final

from common.private_files import sync_directory
from recorder.mcap.records import PART
from recorder.store.folder import (
    DAMAGED,
    DAMAGED_MANIFEST,
    DATA,
    MANIFEST,
    METADATA,
    SEGMENT_FILE,
    clear_temporaries,
)

_DELETING: Final = f"{MANIFEST}.deleting"
_OURS: Final = re.compile(
    rf"{SEGMENT_FILE.pattern}({re.escape(PART)}|{re.escape(DAMAGED)}(\.\d+)?)?|{re.escape(Path(METADATA).name)}"
)
"""Names of what the recorder makes in the folder of the segments."""


def begin(folder: Path) -> None:
    """Makes sure that the deletion of a recording goes on at the next start if it is cut off.

    Raises:
        OSError: the disk fails; nothing has been deleted.
    """
    try:
        (folder / MANIFEST).rename(folder / _DELETING)
    except FileNotFoundError:  # The disk has never taken one.
        (folder / _DELETING).touch()
    sync_directory(folder)


def has_begun(folder: Path) -> bool:
    """Returns whether the deletion of a recording was cut off."""
    return (folder / _DELETING).exists()


def complete(folder: Path) -> None:
    """Deletes what is the recorder's own in a recording's folder, and the folder if nothing else is in it.

    Raises:
        OSError: the disk fails; it can be tried again.
    """
    data = folder / DATA
    if _is_directory(data):
        ours = [each for each in data.iterdir() if _OURS.fullmatch(each.name)]
        for path in [each for each in ours if not _is_directory(each)]:
            path.unlink(missing_ok=True)
        clear_temporaries(data)
        _remove_if_empty(data)
    clear_temporaries(folder)
    # The mark last.
    for name in (DAMAGED_MANIFEST, MANIFEST, _DELETING):
        (folder / name).unlink(missing_ok=True)
    _remove_if_empty(folder)


def clear_away(folder: Path) -> None:
    """Deletes what a killed process has left of files, and the folder of a recording that never had any.

    Raises:
        OSError: the disk fails.
    """
    data = folder / DATA
    clear_temporaries(folder)
    if _is_directory(data):
        clear_temporaries(data)
        if not any(each != data for each in folder.iterdir()):
            _remove_if_empty(data)
    _remove_if_empty(folder)


def _is_directory(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()


def _remove_if_empty(directory: Path) -> None:
    if not any(directory.iterdir()):
        directory.rmdir()
