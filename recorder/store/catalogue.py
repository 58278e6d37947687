"""All recordings on the disk, by ID: read at the start, then changed with the disk."""

import errno
import logging
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from recorder.mcap.reading import summarise
from recorder.mcap.records import PART
from recorder.store import deletion
from recorder.store.folder import (
    DAMAGED_MANIFEST,
    DATA,
    ID,
    MANIFEST,
    RECORDINGS,
    SEGMENT_FILE,
    files_named,
    make_directory,
)
from recorder.store.manifest import (
    DamagedManifestError,
    Kind,
    Manifest,
    RecordingState,
    StopReason,
    read_manifest,
)
from recorder.values import SegmentSummary

_log = logging.getLogger(__name__)

_NUMBERED: Final = re.compile(r"(\d{6,9})\.mcap")


class Catalogue:
    """The recordings below a root.

    Args:
        root: the folder of all recordings.

    Attributes:
        revision: grows with every change.
        problems: by recording, for people: what keeps it from being completed.
        cut_off: folders of deleted recordings that still have files: `end_deletions` goes on.
        unread: IDs of recordings whose manifest the disk refuses to read: it is not written over.
        unwritten: IDs of recordings whose newest manifest the disk has refused: `write_again` tries again.
    """

    def __init__(self, root: Path) -> None:
        self.revision = 0
        self.problems: dict[str, str] = {}
        self.cut_off: set[Path] = set()
        self.unread: set[str] = set()
        self.unwritten: set[str] = set()
        self._folder = root / RECORDINGS
        self._manifests: dict[str, Manifest] = {}

    @property
    def all(self) -> Mapping[str, Manifest]:
        """Every recording, by ID."""
        return self._manifests

    def get(self, recording_id: str) -> Manifest | None:
        """Returns a recording; None if there is no such."""
        return self._manifests.get(recording_id)

    @property
    def next_ordinal(self) -> int:
        """The ordinal of the next recording."""
        return max((each.ordinal + 1 for each in self._manifests.values()), default=1)

    def folder_of(self, manifest: Manifest) -> Path:
        """Returns the folder of a recording."""
        return self._folder / manifest.id

    def load(self) -> None:
        """Reads all manifests; makes those anew that can't be read, and ends deletions that were cut off.

        What does not look like a recording is left alone. One that the disk refuses costs no other one.

        Raises:
            OSError: the folder can't be read or written.
        """
        make_directory(self._folder)
        self.problems.clear()
        self.cut_off.clear()
        self.unread.clear()
        self.unwritten.clear()
        for folder in sorted(self._folder.iterdir()):
            if not ID.fullmatch(folder.name) or folder.is_symlink() or not folder.is_dir():
                continue
            try:
                self._read(folder)
            except OSError as error:
                self._leave_unread(folder, error)

    def set_aside(self, manifest: Manifest, error: OSError) -> None:
        """Lists a recording that the disk refuses as one that has failed, so that all others go on.

        What the disk has of it stays as it is; the next start tries again.
        """
        problem = f"recording {manifest.id} can't be completed: {error.strerror}"
        _log.error("%s (%s)", problem, error)
        self.problems[manifest.id] = f"{problem}; copy what it has and delete it, or check the disk"
        failed = {"state": RecordingState.FAULTED, "stop_reason": StopReason.ERROR}
        self._manifests[manifest.id] = manifest.model_copy(update=failed)
        self.revision += 1

    def _leave_unread(self, folder: Path, error: OSError) -> None:
        """Lists a recording of which nothing is known but that it is there; the next start tries again."""
        problem = f"recording {folder.name} can't be read: {error.strerror}"
        _log.error("%s (%s)", problem, error)
        self.problems[folder.name] = f"{problem}; check the disk, and restart the recorder, which tries again"
        self.unread.add(folder.name)
        self._manifests[folder.name] = Manifest(
            id=folder.name,
            kind=Kind.MANUAL,
            state=RecordingState.FAULTED,
            stop_reason=StopReason.ERROR,
            pinned=True,
        )
        self.revision += 1

    def create(self, manifest: Manifest) -> Path:
        """Makes a recording's folder and returns it.

        Raises:
            OSError: the disk is full or fails.
        """
        folder = self.folder_of(manifest)
        make_directory(folder / DATA)
        self.write(manifest)
        return folder

    def write(self, manifest: Manifest) -> None:
        """Writes a recording's manifest, and has it in place of the former one.

        Raises:
            OSError: the disk is full or fails; then the memory alone has it: see `unwritten`. Or the one that
                is there could not be read: then all stays as it is.
        """
        if manifest.id in self.unread:
            raise OSError(errno.EIO, "its manifest could not be read, and is not written over", manifest.id)
        self._manifests[manifest.id] = manifest
        self.revision += 1
        self.unwritten.add(manifest.id)
        manifest.write(self.folder_of(manifest))
        self.unwritten.discard(manifest.id)

    def write_again(self) -> bool:
        """Writes the manifests that the disk has refused; returns True.

        Raises:
            OSError: the disk is full or fails; it can be tried again.
        """
        for manifest in [self._manifests[each] for each in sorted(self.unwritten)]:
            if self.folder_of(manifest).is_dir():  # It may have been deleted by hand.
                self.write(manifest)
            else:
                self.unwritten.discard(manifest.id)
        return True

    def delete(self, manifest: Manifest) -> None:
        """Deletes a recording's files, and its folder unless something unknown is in it.

        It needs no room: a full disk is what it is for.

        Raises:
            OSError: the disk fails. Unless it is still listed, the rest is deleted later: see `cut_off`.
        """
        folder = self.folder_of(manifest)
        there = folder.is_dir()  # It may have been deleted by hand.
        if there:
            deletion.begin(folder)
        self._forget(manifest)
        if there:
            self._delete(folder)

    def end_deletions(self) -> bool:
        """Deletes what is left of deleted recordings; returns True.

        Raises:
            OSError: the disk fails; it can be tried again.
        """
        for folder in sorted(self.cut_off):
            self._delete(folder)
        return True

    def discard(self, manifest: Manifest) -> None:
        """Deletes a recording, as far as the disk permits."""
        try:
            self.delete(manifest)
        except OSError as error:
            self._forget(manifest)
            _log.warning("what there is of %s is not deleted: %s", manifest.id, error)

    def _read(self, folder: Path) -> None:
        if deletion.has_begun(folder):
            self._go_on_deleting(folder)
            return
        try:
            deletion.clear_away(folder)
        except OSError as error:  # What is whole in it can be read all the same.
            _log.warning("unfinished files stay in %s: %s", folder, error)
        if not folder.is_dir():
            return
        try:
            manifest: Manifest | None = read_manifest(folder)
        except DamagedManifestError as error:
            manifest = _rebuilt(folder, str(error))
        if manifest is None:
            return
        self._manifests[manifest.id] = manifest
        if manifest.deleting:
            self.discard(manifest)

    def _go_on_deleting(self, folder: Path) -> None:
        """Ends a deletion that was cut off. One that the disk refuses to end brings no recording back."""
        try:
            self._delete(folder)
        except OSError as error:
            _log.error("the deletion of %s goes on later: %s", folder.name, error)

    def _delete(self, folder: Path) -> None:
        self.cut_off.add(folder)
        if folder.is_dir():
            deletion.complete(folder)
        self.cut_off.discard(folder)

    def _forget(self, manifest: Manifest) -> None:
        self._manifests.pop(manifest.id, None)
        self.problems.pop(manifest.id, None)
        self.unread.discard(manifest.id)
        self.unwritten.discard(manifest.id)
        self.revision += 1


def segments_in(folder: Path, suffix: str = "") -> list[Path]:
    """Returns the segments in a recording's folder, in order; with PART, the unfinished ones."""
    data = folder / DATA
    if data.is_symlink() or not data.is_dir():
        return []
    return files_named(data, SEGMENT_FILE, suffix)


def first_free_number(folder: Path) -> int:
    """Returns the number of a recording's next segment, by the files that are there, damaged ones included.

    Raises:
        OSError: the disk fails.
    """
    names = [path.name for path in (folder / DATA).iterdir()] if (folder / DATA).is_dir() else []
    return max((int(found[1]) + 1 for name in names if (found := _NUMBERED.match(name))), default=0)


def _rebuilt(folder: Path, why: str) -> Manifest | None:
    """Returns a manifest made from the segments; None if there are none. The damaged one is kept aside."""
    finals = segments_in(folder)
    if not finals and not segments_in(folder, PART):
        return None
    _log.warning("the manifest of recording %s is made anew from its segments: %s", folder.name, why)
    if (folder / MANIFEST).exists():
        (folder / MANIFEST).replace(folder / DAMAGED_MANIFEST)
    manifest = Manifest(
        id=folder.name,
        kind=Kind.MANUAL,
        state=RecordingState.RECOVERED,
        stop_reason=StopReason.INTERRUPTED,
        # Whether it was pinned or had to be copied is lost with the manifest.
        pinned=True,
    )
    damaged = []
    for path in finals:
        name = f"{DATA}/{path.name}"
        if summary := readable(path):
            manifest = manifest.with_segment(name, summary)
        else:
            damaged.append(name)
    manifest = manifest.spanning()
    for name in damaged:
        manifest = manifest.without_segment(name)
    try:
        manifest.write(folder)
    except OSError as error:
        _log.error("the manifest of %s is not on the disk: %s", manifest.id, error)
    return manifest


def readable(path: Path) -> SegmentSummary | None:
    """Returns what a final segment contains; None, with a line in the log, if it can't be read."""
    try:
        summary = summarise(path)
    except OSError as error:
        _log.error("%s can't be read and is left alone: %s", path, error.strerror)
        return None
    if summary is None:
        _log.warning("%s is damaged and is left alone", path)
    return summary
