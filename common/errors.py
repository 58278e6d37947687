"""Errors for people: what happened, what it means, what to type."""

from enum import IntEnum


class ExitCode(IntEnum):
    """How our programs end."""

    DONE = 0
    FAILED = 1
    """Refused, or did not work."""
    USAGE = 2
    """The command line or the configuration is wrong."""
    UNREACHABLE = 3
    """The other side does not answer."""


class UserError(Exception):
    """Something a person can mend. Programs print it as one line and end; they never show a traceback.

    Args:
        what: what happened, naming the thing it happened to.
        remedy: what to do or to type. Empty only where `what` says it already.
        exit_code: how the program ends.
    """

    def __init__(self, what: str, remedy: str = "", *, exit_code: ExitCode = ExitCode.FAILED) -> None:
        super().__init__(what)
        self.what = what
        self.remedy = remedy
        self.exit_code = exit_code

    def __str__(self) -> str:
        """One printable line, whatever the parts quote."""
        text = f"{self.what}. {self.remedy}" if self.remedy else self.what
        return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())


class DomainError(Exception):
    """What a caller asked for can't be done. Knows no transport; common.rpc tells it to gRPC callers.

    The text is for the caller to read and says what to do.
    """


class InvalidRequestError(DomainError):
    """The request makes no sense as it stands; sending it again won't help. Nothing was changed."""


class NotNowError(DomainError):
    """The request is in order, but the state of things forbids it; it may work later."""
