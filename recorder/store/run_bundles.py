"""The folders of the robot's own experiments (run bundles): listed and exported as recordings, never changed.

A bundle is a folder with a `manifest.yaml`. Its ID here is "run-" and the folder's name, or a hash of the
name where that has other characters than IDs may have.
"""

import hashlib
import logging
import os
import re
import stat
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import islice
from pathlib import Path
from typing import Final, NoReturn

from common.reader_threads import ClosedError
from recorder.store.manifest import RecordingState

_log = logging.getLogger(__name__)

MAX_FILES: Final = 100_000
"""A folder with more is not listed: a part of it would pass for the whole."""
_MAX_BUNDLES: Final = 10_000
_MANIFEST: Final = "manifest.yaml"
_MANIFEST_BYTES: Final = 1024 * 1024
_PREFIX: Final = "run-"
_PLAIN: Final = re.compile(r"[A-Za-z0-9_-]{1,60}")
_STATE: Final = re.compile(
    rb"^(?:state|status)\s*:\s*[\"']?(complete|in_progress|incomplete)\b", re.MULTILINE
)
_STATES: Final = {
    b"complete": RecordingState.COMPLETE,
    b"in_progress": RecordingState.RECORDING,
    b"incomplete": RecordingState.RECOVERED,
}
_NS_PER_MS: Final = 1_000_000
_MAX_NAME: Final = 255
"""Of a file below its bundle, as requests are limited; one with a longer name is counted, and not listed."""


class TooManyFilesError(OSError):
    """A folder with more than MAX_FILES files."""


@dataclass(frozen=True, slots=True)
class BundleFile:
    """A file of a bundle; `changed_ns` is its modification time, which stands for its content."""

    name: str
    size: int
    changed_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class BundleSummary:
    """A folder of an experiment as it is listed; instants in ns since 1970-01-01 UTC, from its files' times.

    Attributes:
        size: Bytes of its files.
        unlisted: Names that can't be requested: too long, not printable, or of no plain file, as a link's.
    """

    id: str
    folder: Path
    state: RecordingState
    size: int
    file_count: int
    began_ns: int
    ended_ns: int
    unlisted: int = 0

    @property
    def started_unix_ms(self) -> int:
        """When it began, as recordings say it."""
        return self.began_ns // _NS_PER_MS

    @property
    def final(self) -> bool:
        """Whether nothing more is written to it."""
        return self.state is not RecordingState.RECORDING


@dataclass(frozen=True, slots=True, kw_only=True)
class Bundle(BundleSummary):
    """A folder of an experiment with its files; a list of all bundles would have no room for these."""

    files: tuple[BundleFile, ...]

    @property
    def summary(self) -> BundleSummary:
        """It, without its files."""
        return BundleSummary(**{each.name: getattr(self, each.name) for each in fields(BundleSummary)})

    def file(self, name: str) -> BundleFile | None:
        """Returns the file with this name; None if it has none."""
        return next((file for file in self.files if file.name == name), None)


class RunBundles:
    """Finds bundles in the configured folders. Its methods read the disk: they are for threads.

    Args:
        folders: that hold bundles. One that can't be read has none, which the log says.
    """

    def __init__(self, folders: Sequence[Path]) -> None:
        self._folders = tuple(folders)
        self._refused: set[Path] = set()
        """Folders of which the log says that they are not listed."""
        self._stopped = threading.Event()

    def stop(self) -> None:
        """Ends what reads folders in other threads, and any that is begun later; they raise ClosedError."""
        self._stopped.set()

    def all(self) -> list[BundleSummary]:
        """Returns all bundles, without those that can't be read whole, or have more than MAX_FILES files."""
        found: dict[str, BundleSummary] = {}
        for folder in self._candidates():
            try:
                bundle = _read(folder, self._stopped)
            except OSError as error:
                if not isinstance(error, FileNotFoundError):  # That one has gone meanwhile.
                    self._refuse(folder, error)
                continue
            found.setdefault(bundle.id, bundle.summary)
            if len(found) >= _MAX_BUNDLES:
                break
        return list(found.values())

    def get(self, bundle_id: str) -> Bundle | None:
        """Returns a bundle; None if there is no such."""
        if not bundle_id.startswith(_PREFIX):
            return None
        for folder in self._candidates(bundle_id):
            try:
                return _read(folder, self._stopped)
            except OSError:
                return None
        return None

    def _refuse(self, folder: Path, error: OSError) -> None:
        """Logs once that a folder is not listed."""
        if folder not in self._refused:
            self._refused.add(folder)
            where = f"{error.filename}: {error.strerror}" if error.filename else error
            _log.warning("%s is not listed: %s", folder, where)

    def _candidates(self, bundle_id: str = "") -> Iterator[Path]:
        """Yields the folders that are bundles: those with an ID, or all."""
        for parent in self._folders:
            try:
                entries = sorted(parent.iterdir())
            except OSError as error:
                self._refuse(parent, error)
                continue
            for each in entries:
                if self._stopped.is_set():
                    raise ClosedError
                if bundle_id and _id_of(each.name) != bundle_id:
                    continue
                try:
                    is_bundle = _is_bundle(each)
                except OSError as error:  # Another user's, which must not cost the others.
                    self._refuse(each, error)
                    continue
                if is_bundle:
                    yield each


def _is_bundle(folder: Path) -> bool:
    """Returns whether a folder is a bundle.

    Raises:
        OSError: it can't be looked into.
    """
    if folder.is_symlink():
        return False
    try:
        return stat.S_ISREG((folder / _MANIFEST).stat().st_mode)
    except (FileNotFoundError, NotADirectoryError):
        return False


def _id_of(name: str) -> str:
    if _PLAIN.fullmatch(name):
        return f"{_PREFIX}{name}"
    return f"{_PREFIX}{hashlib.sha256(os.fsencode(name)).hexdigest()[:32]}"


def _read(folder: Path, stopped: threading.Event) -> Bundle:
    """Reads a bundle's folder.

    Raises:
        OSError: it can't be read.
        TooManyFilesError: it has too many files.
        ClosedError: it was stopped.
    """
    with (folder / _MANIFEST).open("rb") as file:
        stated = _STATE.search(file.read(_MANIFEST_BYTES))
    found = list(islice(_entries(folder, stopped), MAX_FILES + 1))
    if len(found) > MAX_FILES:
        raise TooManyFilesError(f"it has more than {MAX_FILES} files; split it, or copy it by other means")
    files = sorted(
        (each for each in found if each and _is_requestable(each.name)), key=lambda each: each.name
    )
    # Any file system may have files from before 1970.
    times = [max(each.changed_ns, 0) for each in files]
    return Bundle(
        id=_id_of(folder.name),
        folder=folder,
        state=_STATES[stated[1]] if stated else RecordingState.RECOVERED,
        size=sum(each.size for each in files),
        file_count=len(files),
        files=tuple(files),
        began_ns=min(times, default=0),
        ended_ns=max(times, default=0),
        unlisted=len(found) - len(files),
    )


def _entries(folder: Path, stopped: threading.Event) -> Iterator[BundleFile | None]:
    """Yields the files below a folder, and None for each name that is neither a plain file nor a folder.

    Raises:
        OSError: a folder below can't be read: without it, a part would pass for the whole.
        ClosedError: it was stopped.
    """
    for directory, folders, names in os.walk(folder, onerror=_fail):
        for name in (*names, *folders):
            if stopped.is_set():
                raise ClosedError
            path = Path(directory) / name
            status = path.lstat()
            if stat.S_ISREG(status.st_mode):
                yield BundleFile(path.relative_to(folder).as_posix(), status.st_size, status.st_mtime_ns)
            elif not stat.S_ISDIR(status.st_mode):
                yield None


def _fail(error: OSError) -> NoReturn:
    raise error


def _is_requestable(name: str) -> bool:
    return name.isprintable() and len(name) <= _MAX_NAME
