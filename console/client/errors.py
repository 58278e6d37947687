"""The exceptions of the client: one small family, each with a remedy.

They are named after the condition, without the suffix "Error". None of them knows gRPC:
`console.client.error_table` maps gRPC codes to them.
"""

# ruff: noqa: N818 - `except Unreachable` reads as a sentence.

from typing import ClassVar

from common.errors import ExitCode, UserError


class GatewayError(UserError):
    """A call to a robot's gateway failed. `str()` is one line: what happened and what to do.

    Args:
        what: What happened, with the robot's address.
        remedy: What to do; the class's own advice when left out.
    """

    kind: ClassVar[str] = "failed"
    """Stable identifier for programs; `robotctl --json` prints it."""
    ends_with: ClassVar[ExitCode] = ExitCode.FAILED
    """Exit code of a program that can't continue without the answer."""
    advice: ClassVar[str] = "Check the gateway's log on the robot"

    reason: str = ""
    """The gateway's reason (docs/errors.md); empty where it gave none."""
    fields: tuple[str, ...] = ()
    """The invalid fields of the request."""
    retry_after_s: float | None = None
    """When to retry; None where the gateway does not say."""

    def __init__(self, what: str, remedy: str | None = None) -> None:
        super().__init__(what, self.advice if remedy is None else remedy, exit_code=self.ends_with)


class Unreachable(GatewayError):
    """No gateway answers there: nothing listens, no route or name, a silent link, or the gateway stops."""

    kind = "unreachable"
    ends_with = ExitCode.UNREACHABLE
    advice = "Check the address, the network, and that robot-gateway runs on the robot"


class DeadlineExceeded(GatewayError):
    """The gateway did not answer in time. Whether it carried out the call is unknown."""

    kind = "deadline_exceeded"
    ends_with = ExitCode.UNREACHABLE
    advice = "The robot is overloaded or the link is bad: try again, or allow more time"


class Refused(GatewayError):
    """The gateway refused the call. A retry fails as well until the reason is gone."""

    kind = "refused"
    advice = "The robot's answer gives the reason"


class NotAllowed(Refused):
    """This client is not authenticated, or lacks the role."""

    kind = "not_allowed"
    advice = "Ask this robot's administrator for a login, then type: robotctl login NAME HOST:PORT FILE"


class NotTrusted(GatewayError):
    """The server's certificate does not prove that it is the robot: it is another's, or has expired."""

    kind = "not_trusted"
    advice = (
        "Store this robot's login: robotctl login NAME HOST:PORT FILE. If it is stored already, "
        "ask the robot's administrator for a new one"
    )


class Overloaded(Refused):
    """The gateway has reached a limit of connections, streams or requests."""

    kind = "overloaded"
    advice = "Wait, then send fewer requests"


class InvalidRequest(GatewayError):
    """The request is invalid; nothing changed on the robot."""

    kind = "invalid_request"
    advice = "Correct the request; this client may be newer or older than the gateway"


class Unsupported(GatewayError):
    """The gateway does not have the method: it is older than this client."""

    kind = "unsupported"
    advice = "Update the gateway, or use the client of the gateway's version"


class GatewayFailed(GatewayError):
    """The gateway had an internal error, or sent an unreadable answer."""

    kind = "gateway_failed"


class Cancelled(GatewayError):
    """The client was closed by this program."""

    kind = "cancelled"
    advice = "Open a new client and repeat the call"
