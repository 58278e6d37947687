"""Where recordings are in the store: names from robots, which may be anything, become keys. Pure.

| key | content |
|---|---|
| FLEET/ROBOT/RECORDING/FILE | a file |
| FLEET/ROBOT/RECORDING.receipts/FILE | the signed receipt of that file |
| FLEET/ROBOT/RECORDING.recording | the recording with its receipt (StoredRecording) |

The robot is that of the request's subject, which the hub enforces. No recording's ID has a dot, so that a
robot can't send a file to the place of a receipt.
"""

from dataclasses import dataclass
from typing import Final

from fleet.names import RECORDING_ID

RECORDING: Final = ".recording"
"""What the key of a recording with its receipt ends with."""
_FORBIDDEN: Final = frozenset('\\:*?"<>|')
"""What file systems, drives and streams give a meaning to: recordings are copied to many."""
_MOST_BYTES: Final = 255
_MOST_FOLDERS: Final = 16


class BadNameError(Exception):
    """A name that no recording or file may have; the text says why."""


@dataclass(frozen=True, slots=True)
class RecordingKeys:
    """The keys of one recording.

    Raises:
        BadNameError: The ID is none.
    """

    fleet: str
    robot: str
    recording_id: str

    def __post_init__(self) -> None:
        if not RECORDING_ID.fullmatch(self.recording_id):
            raise BadNameError("the recording's ID is not one: letters, digits, '-' and '_', at most 64")

    @property
    def folder(self) -> str:
        """Prefix of its files."""
        return f"{self.fleet}/{self.robot}/{self.recording_id}"

    @property
    def recording(self) -> str:
        """Of the recording with its receipt."""
        return f"{self.folder}{RECORDING}"

    def file(self, name: str) -> str:
        """Returns the key of a file."""
        return f"{self.folder}/{checked(name)}"

    def receipt(self, name: str) -> str:
        """Returns the key of a file's receipt."""
        return f"{self.folder}.receipts/{checked(name)}"


def checked(name: str) -> str:
    """Returns a file's name.

    Raises:
        BadNameError: It is not one that may be below a recording, on any file system.
    """
    parts = name.split("/")
    if len(name.encode()) > _MOST_BYTES or len(parts) > _MOST_FOLDERS or not all(map(_is_usable, parts)):
        raise BadNameError(f"a file can't be called {name[:80]!a}")
    return name


def _is_usable(part: str) -> bool:
    return (
        part != ""
        # Neither control characters nor those that turn the direction of writing or are not seen.
        and part.isprintable()
        and not _FORBIDDEN.intersection(part)
        and part[-1] not in ". "  # "." and ".." as well
    )
