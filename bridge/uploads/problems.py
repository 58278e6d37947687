"""Why an upload did not succeed: of this recording alone, or of what all of them need."""


class AttemptError(Exception):
    """An attempt failed; the text says why, for people. It is tried again."""


class RecordingError(AttemptError):
    """This recording can't be uploaded at present; others may."""


class CutError(AttemptError):
    """The gateway, the hub or the store fails: no recording can be uploaded at present."""


class GoneError(Exception):
    """The recording is not on the robot any more."""
