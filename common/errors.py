"""Errors: those a program ends with, for people, and those an RPC is refused with, for callers."""

from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar

from common.reasons import Reason


class ExitCode(IntEnum):
    """Exit codes of all programs."""

    DONE = 0
    FAILED = 1
    """Refused, or an error occurred."""
    USAGE = 2
    """The command line or the configuration is invalid."""
    UNREACHABLE = 3
    """The other side does not respond."""


class UserError(Exception):
    """An error that the user can fix. Programs print it as one line, without a traceback, and exit.

    Args:
        what: what happened, naming the file, address or value concerned.
        remedy: what to do or to type. Empty only where `what` implies it.
        exit_code: of the program.
    """

    kind: ClassVar[str] = ""
    """Stable identifier for programs; empty where the exit code is the only one."""

    def __init__(self, what: str, remedy: str = "", *, exit_code: ExitCode = ExitCode.FAILED) -> None:
        super().__init__(what)
        self.what = what
        self.remedy = remedy
        self.exit_code = exit_code

    def __str__(self) -> str:
        """Returns both parts as one line; unprintable characters, which either may quote, become spaces."""
        stop = "" if self.what.endswith("?") else "."
        text = f"{self.what}{stop} {self.remedy}" if self.remedy else self.what
        return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())


@dataclass(frozen=True, slots=True)
class FieldViolation:
    """A rule that one field of a request breaks; `field` is empty for a rule of the whole message."""

    field: str
    description: str


class DomainError(Exception):
    """A request that can't be fulfilled. Knows no transport; common.grpc_errors maps it to a gRPC status.

    Its text is shown to the caller and says what to do; the attributes are for programs.
    """

    reason: Reason
    """Machine-readable cause: of the class, or given to the constructor."""
    violations: tuple[FieldViolation, ...] = ()
    retry_after_s: float | None = None
    """Seconds after which a retry may succeed; None if unknown."""


class SpecificError(DomainError):
    """An error with one of several reasons, which its constructor is given; only its subclasses are raised.

    Args:
        text: for people: what, and what to do.
        reason: the same for programs.
    """

    def __init__(self, text: str, reason: Reason) -> None:
        super().__init__(text)
        self.reason = reason


class InvalidRequestError(DomainError):
    """The request is invalid and will remain so. Nothing was changed."""

    reason = Reason.INVALID_REQUEST

    def __init__(self, text: str = "", violations: tuple[FieldViolation, ...] = ()) -> None:
        super().__init__(text)
        self.violations = violations


class DefectError(DomainError):
    """A defect of ours; the log has the details, and the caller gets none of them."""

    reason = Reason.INTERNAL


class UnknownServiceError(DomainError):
    """The health service knows no service of the requested name."""

    reason = Reason.UNKNOWN_SERVICE


class TooMuchError(SpecificError):
    """The caller exceeds a limit, or a resource is exhausted.

    Args:
        text: which limit, and what to do.
        reason: which limit, for programs.
        retry_after_s: seconds after which a retry may succeed.
    """

    def __init__(self, text: str, reason: Reason, retry_after_s: float | None = None) -> None:
        super().__init__(text, reason)
        self.retry_after_s = retry_after_s


class NotRunningError(DomainError):
    """The preview is not running: there is no stream to act on."""

    reason = Reason.PREVIEW_NOT_RUNNING


class PreconditionError(SpecificError):
    """The robot's state does not permit the request.

    Args:
        text: why, and what to do.
        reason: why, for programs.
    """


class ConflictError(SpecificError):
    """Another caller has what the request needs.

    Args:
        text: who, and what to do.
        reason: why, for programs.
    """


class DriveUnreachableError(DomainError):
    """The drive program does not answer."""

    reason = Reason.DRIVE_UNREACHABLE


class NotFoundError(SpecificError):
    """What the request names does not exist.

    Args:
        text: what, and what to do.
        reason: what, for programs.
    """


class DamagedError(DomainError):
    """A file of a recording can't be read, or has other bytes than were written."""

    reason = Reason.RECORDING_DAMAGED


class RecorderUnreachableError(DomainError):
    """The recorder does not answer."""

    reason = Reason.RECORDER_UNREACHABLE


class BridgeUnreachableError(DomainError):
    """The bridge to the robot's fleet does not answer."""

    reason = Reason.BRIDGE_UNREACHABLE


class NotAuthenticatedError(SpecificError):
    """The caller is not authenticated: no credential, or one that is not valid.

    Args:
        text: why, and what to do.
        reason: why, for programs.
    """


class NotAllowedError(DomainError):
    """The caller is authenticated, but their role does not permit the request."""

    reason = Reason.ROLE_TOO_LOW
