"""Why an upload did not succeed: of this recording alone, or of what all of them need."""

from typing import Final

from common.printable import printable

_LONGEST_TEXT: Final = 300
"""Characters: it is part of the robot's status, and of each of its states at the hub."""


class AttemptError(Exception):
    """An attempt failed; the text says why, for people. It is tried again.

    Args:
        text: Words of the store or the hub in it may be anything: it is cut and made printable.
    """

    def __init__(self, text: str) -> None:
        super().__init__(printable(text)[:_LONGEST_TEXT])


class RecordingError(AttemptError):
    """This recording can't be uploaded at present; others may."""


class CutError(AttemptError):
    """The gateway, the hub or the store fails: no recording can be uploaded at present."""


class GoneError(Exception):
    """The recording is not on the robot any more."""
