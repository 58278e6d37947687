"""All recordings on the disk, by ID: read at the start, then changed with the disk."""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from recorder.mcap.reading import summarise
from recorder.mcap.records import PART
from recorder.store.folder import (
    DATA,
    ID,
    MANIFEST,
    METADATA,
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

_log = logging.getLogger(__name__)

_DAMAGED: Final = f"{MANIFEST}.damaged"


class Catalogue:
    """The recordings below a root.

    Args:
        root: the folder of all recordings.

    Attributes:
        revision: grows with every change.
    """

    def __init__(self, root: Path) -> None:
        self.revision = 0
        self._folder = root / RECORDINGS
        self._manifests: dict[str, Manifest] = {}

    @property
    def all(self) -> Mapping[str, Manifest]:
        """Every recording, by ID."""
        return self._manifests

    def get(self, recording_id: str) -> Manifest | None:
        """Returns a recording; None if there is no such."""
        return self._manifests.get(recording_id)

    def folder_of(self, manifest: Manifest) -> Path:
        """Returns the folder of a recording."""
        return self._folder / manifest.id

    def load(self) -> None:
        """Reads all manifests; makes those anew that can't be read, and ends deletions that were cut off.

        What does not look like a recording is left alone.

        Raises:
            OSError: the folder can't be read or written.
        """
        make_directory(self._folder)
        for folder in sorted(self._folder.iterdir()):
            if not ID.fullmatch(folder.name) or folder.is_symlink() or not folder.is_dir():
                continue
            try:
                manifest: Manifest | None = read_manifest(folder)
            except DamagedManifestError as error:
                manifest = _rebuilt(folder, str(error))
            if manifest is None:
                continue
            self._manifests[manifest.id] = manifest
            if manifest.deleting:
                self.delete(manifest)

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
            OSError: the disk is full or fails; then the memory alone has it.
        """
        self._manifests[manifest.id] = manifest
        self.revision += 1
        manifest.write(self.folder_of(manifest))

    def delete(self, manifest: Manifest) -> None:
        """Deletes a recording's files, and its folder unless something unknown is in it.

        Raises:
            OSError: the disk fails; the next start goes on.
        """
        folder = self.folder_of(manifest)
        manifest.model_copy(update={"deleting": True}).write(folder)
        self._manifests.pop(manifest.id, None)
        self.revision += 1
        parts = segments_in(folder, PART)
        for path in (*(folder / file.name for file in manifest.files), *parts, folder / METADATA):
            path.unlink(missing_ok=True)
        for name in (_DAMAGED, MANIFEST):
            (folder / name).unlink(missing_ok=True)
        for directory in (folder / DATA, folder):
            if not any(directory.iterdir()):
                directory.rmdir()


def segments_in(folder: Path, suffix: str = "") -> list[Path]:
    """Returns the segments in a recording's folder, in order; with PART, the unfinished ones."""
    data = folder / DATA
    if data.is_symlink() or not data.is_dir():
        return []
    return files_named(data, SEGMENT_FILE, suffix)


def _rebuilt(folder: Path, why: str) -> Manifest | None:
    """Returns a manifest made from the segments; None if there are none. The damaged one is kept aside."""
    finals = segments_in(folder)
    if not finals and not segments_in(folder, PART):
        return None
    _log.warning("the manifest of recording %s is made anew from its segments: %s", folder.name, why)
    if (folder / MANIFEST).exists():
        (folder / MANIFEST).replace(folder / _DAMAGED)
    manifest = Manifest(
        id=folder.name,
        kind=Kind.MANUAL,
        state=RecordingState.RECOVERED,
        stop_reason=StopReason.INTERRUPTED,
        # Whether it was pinned or had to be copied is lost with the manifest.
        pinned=True,
    )
    for path in finals:
        summary = summarise(path)
        if summary is None:
            _log.warning("%s can't be read and is left alone", path)
            continue
        manifest = manifest.with_segment(f"{DATA}/{path.name}", summary)
    manifest = manifest.spanning()
    manifest.write(folder)
    return manifest
