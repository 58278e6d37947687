"""`robot-recorder recover`: makes a disk whole that was taken out of a robot, without any service."""

import os
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from common.errors import UserError
from recorder.mcap.records import PART
from recorder.mcap.recovery import is_untouched, recover
from recorder.store.catalogue import Catalogue
from recorder.store.folder import ID, RECORDINGS
from recorder.store.lock import folder_lock, has_lock
from recorder.store.ring import Ring, has_segments
from recorder.store.salvage import salvage

_RING: Final = "ring"


@dataclass(frozen=True, slots=True)
class Recovered:
    """One file that was made whole, or could not be.

    Attributes:
        file: its final name; of one with nothing in it, or that the disk refused, the name that it had.
        messages: that it has.
        size: in bytes.
        error: why it could not be made whole; empty if it is.
        damaged: whether its damage leaves no message; then it is kept.
    """

    file: str
    messages: int = 0
    size: int = 0
    error: str = ""
    damaged: bool = False

    def as_dict(self) -> dict[str, Any]:
        """Returns it as a JSON object."""
        return asdict(self)


def sentence(each: Recovered) -> str:
    """Returns a line for people."""
    if each.error:
        return f"{each.file}: {each.error}"
    if each.damaged:
        return f"{each.file}: its damage leaves no message; it is kept"
    if not each.messages:
        return f"{each.file}: nothing was in it"
    return f"{each.file}: {each.messages} messages, {each.size} bytes"


def recover_below(named: Path) -> list[Recovered]:
    """Makes every unfinished file whole, and completes the recordings that they belong to.

    Args:
        named: a folder that is, or is in, or contains, a folder of recordings; or one unfinished file, which
            is then all that is changed.

    Raises:
        UserError: there is no such, or a recorder uses it.
    """
    path = named.resolve()
    if path.is_file() and not path.name.endswith(PART):
        raise UserError(f"{named} is not unfinished", f"Name a folder, or a file *.mcap{PART}")
    if not path.exists():
        raise UserError(f"{named} does not exist", "Name the folder of recordings, or one of them")
    roots = _roots_of(path)
    with ExitStack() as stack:
        for root in roots:
            stack.enter_context(folder_lock(root))
        if path.is_file():
            return [_recovered(path)]
        found = [_recovered(part) for part in sorted(path.rglob(f"*.mcap{PART}"))]
        for root in roots:
            if (root / RECORDINGS).is_dir():
                _complete(root)
    return found


def _roots_of(path: Path) -> list[Path]:
    """Returns the folders that a recorder may use at present: above a path, and below it."""
    below = (Path(folder) for folder, _, _ in os.walk(path))
    return [each for each in (*reversed(path.parents), *below) if _is_root(each)]


def _is_root(folder: Path) -> bool:
    """Returns whether a recorder keeps its recordings, or a ring of its own, in a folder."""
    recordings = folder / RECORDINGS
    if has_lock(folder):
        return recordings.is_dir() or has_segments(folder)
    return recordings.is_dir() and any(ID.fullmatch(each.name) for each in recordings.iterdir())


def _complete(root: Path) -> None:
    try:
        catalogue = Catalogue(root)
        catalogue.load()
        ring = Ring(root / _RING, 0)
        if ring.directory.is_dir():
            ring.load()
        salvage(catalogue, ring, boot_id="")
    except OSError as error:
        raise UserError(
            f"the recordings in {root} can't be completed: {error}", "Check the disk, and its free space"
        ) from error


def _recovered(part: Path) -> Recovered:
    try:
        summary = recover(part)
        if summary is None:
            return Recovered(str(part), damaged=not is_untouched(part))
    except OSError as error:
        return Recovered(str(part), error=error.strerror or str(error))
    return Recovered(str(summary.path), summary.messages, summary.size)
