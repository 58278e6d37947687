"""Why a message is not shown. Pure."""

from enum import Enum


class Reason(Enum):
    """What is wrong with a message; the name of a counter."""

    MALFORMED = "malformed"
    """The bytes are no message of the topic's type."""
    ENCODING = "encoding"
    """An encoding that can't be shown."""
    SIZE = "size"
    """No pixels, or too many."""
    STEP = "step"
    """A row is said to be shorter than its pixels."""
    DATA = "data"
    """Fewer bytes than the rows need."""
    COMPRESSED = "compressed"
    """No JPEG or PNG picture."""


class RefusedError(Exception):
    """A message that is not shown.

    Args:
        reason: for the counters.
        text: what is wrong, as the predicate of a sentence about the message.
    """

    def __init__(self, reason: Reason, text: str) -> None:
        super().__init__(text)
        self.reason = reason
        self.text = text
