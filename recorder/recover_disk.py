"""`robot-recorder recover`: makes a disk whole that was taken out of a robot, without any service."""

from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from common.errors import UserError
from recorder.mcap.records import PART
from recorder.mcap.recovery import recover
from recorder.store.catalogue import Catalogue
from recorder.store.folder import MANIFEST, RECORDINGS
from recorder.store.lock import folder_lock
from recorder.store.ring import Ring
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
    """

    file: str
    messages: int = 0
    size: int = 0
    error: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Returns it as a JSON object."""
        return asdict(self)


def sentence(each: Recovered) -> str:
    """Returns a line for people."""
    if each.error:
        return f"{each.file}: {each.error}"
    if not each.messages:
        return f"{each.file}: nothing was in it"
    return f"{each.file}: {each.messages} messages, {each.size} bytes"


def recover_below(directory: Path) -> list[Recovered]:
    """Makes every unfinished file whole, and completes the recordings that they belong to.

    Args:
        directory: a folder of recordings, the folder of one, or one unfinished file.

    Raises:
        UserError: there is no such, or a recorder uses it.
    """
    if directory.is_file():
        return [_recovered(directory)]
    if not directory.is_dir():
        raise UserError(f"{directory} does not exist", "Name the folder of recordings, or one of them")
    with ExitStack() as stack:
        root = _root_of(directory)
        if root:
            stack.enter_context(folder_lock(root))
        found = [_recovered(part) for part in sorted(directory.rglob(f"*.mcap{PART}"))]
        if root and not any(each.error for each in found):
            _complete(root)
    return found


def _root_of(directory: Path) -> Path | None:
    """Returns the folder of recordings that a directory is, or is in; None if there is none."""
    if (directory / RECORDINGS).is_dir():
        return directory
    if (directory / MANIFEST).is_file() and directory.parent.name == RECORDINGS:
        return directory.parent.parent
    return None


def _complete(root: Path) -> None:
    try:
        catalogue = Catalogue(root)
        catalogue.load()
        ring = Ring(root / _RING, 0)
        if ring.directory.is_dir():
            ring.load()
        salvage(catalogue, ring.segments, boot_id="")
    except OSError as error:
        raise UserError(
            f"the recordings in {root} can't be completed: {error}", "Check the disk, and its free space"
        ) from error


def _recovered(part: Path) -> Recovered:
    try:
        summary = recover(part)
    except OSError as error:
        return Recovered(str(part), error=error.strerror or str(error))
    if summary is None:
        return Recovered(str(part))
    return Recovered(str(summary.path), summary.messages, summary.size)
