"""Errors for people: what happened, what it means, what to type."""

from dataclasses import dataclass
from enum import IntEnum

from common.reasons import Reason


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


@dataclass(frozen=True, slots=True)
class FieldViolation:
    """What is wrong with one field of a request; `field` is empty when only the whole is."""

    field: str
    description: str


class DomainError(Exception):
    """What a caller asked for can't be done. Knows no transport; common.rpc tells it to gRPC callers.

    The text is for the caller to read and says what to do; the rest is the same for programs.
    """

    reason: Reason
    """A stable word; each kind of error has its own, or takes one when it is made."""
    violations: tuple[FieldViolation, ...] = ()
    retry_after_s: float | None = None
    """When it may work; None when nobody knows."""


class InvalidRequestError(DomainError):
    """The request makes no sense as it stands; sending it again won't help. Nothing was changed."""

    reason = Reason.INVALID_REQUEST

    def __init__(self, text: str = "", violations: tuple[FieldViolation, ...] = ()) -> None:
        super().__init__(text)
        self.violations = violations


class UnknownServiceError(DomainError):
    """Nobody here has that name."""

    reason = Reason.UNKNOWN_SERVICE


class TooMuchError(DomainError):
    """The caller wants more than its share, or more than there is.

    Args:
        text: of what, and what to do.
        reason: of what, for programs.
        retry_after_s: when there may be room again.
    """

    def __init__(self, text: str, reason: Reason, retry_after_s: float | None = None) -> None:
        super().__init__(text)
        self.reason = reason
        self.retry_after_s = retry_after_s


class NotAuthenticatedError(DomainError):
    """Nobody knows who asks.

    Args:
        text: why, and what to do.
        reason: why, for programs.
    """

    def __init__(self, text: str, reason: Reason) -> None:
        super().__init__(text)
        self.reason = reason


class NotAllowedError(DomainError):
    """The caller is known and may not do this."""

    reason = Reason.ROLE_TOO_LOW
