"""What went wrong last with the preview, as operators are shown it."""

import logging

_log = logging.getLogger(__name__)


class LastError:
    """A text that stays until something clears it, or another one takes its place.

    Attributes:
        text: for people; empty after `clear`.
    """

    def __init__(self) -> None:
        self.text = ""

    def report(self, text: str, level: int = logging.ERROR) -> None:
        """Shows a text, and logs it."""
        _log.log(level, "%s", text)
        self.text = text

    def clear(self) -> None:
        """Shows none: what went wrong is no longer so."""
        self.text = ""
