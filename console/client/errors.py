"""What can go wrong between a client and a robot: one small family, each member with what to do.

They are named by what happened, without the word "error". None knows gRPC: `console.client.error_table` is
the one place that turns a gRPC code into one of these.
"""

# ruff: noqa: N818 - `except Unreachable` reads as what it is.

from typing import ClassVar

from common.errors import ExitCode, UserError


class GatewayError(UserError):
    """A call to a robot's gateway did not work. `str()` is one line: what happened and what to do.

    Args:
        what: what happened, naming the robot's address.
        remedy: what to do; the member's own advice when left out.
    """

    kind: ClassVar[str] = "failed"
    """A stable word for machines: `robotctl --json` prints it."""
    ends_with: ClassVar[ExitCode] = ExitCode.FAILED
    """How a program ends that can't go on without the answer."""
    advice: ClassVar[str] = "Look into the gateway's log on the robot"

    reason: str = ""
    """The gateway's own stable word for why it refused (docs/errors.md); empty where it told none."""
    fields: tuple[str, ...] = ()
    """The fields of the request that it refused."""
    retry_after_s: float | None = None
    """When to try again; None when nobody knows."""

    def __init__(self, what: str, remedy: str | None = None) -> None:
        super().__init__(what, self.advice if remedy is None else remedy, exit_code=self.ends_with)


class Unreachable(GatewayError):
    """No gateway answers there: nothing listens, no route, no such name, or the link went silent."""

    kind = "unreachable"
    ends_with = ExitCode.UNREACHABLE
    advice = "Check the address (--target HOST:PORT), the network, and that robot-gateway runs on the robot"


class DeadlineExceeded(GatewayError):
    """The gateway did not answer in time. Whether it did what was asked is not known."""

    kind = "deadline_exceeded"
    ends_with = ExitCode.UNREACHABLE
    advice = "The robot is overloaded or the link is bad: try again, or allow more time"


class Refused(GatewayError):
    """The gateway understood and said no. Asking again changes nothing until the reason is gone."""

    kind = "refused"
    advice = "The robot's answer gives the reason"


class NotAllowed(Refused):
    """This client may not do that, or did not say who it is."""

    kind = "not_allowed"
    advice = "Ask whoever keeps this robot for access, then type: robotctl login"


class NotTrusted(GatewayError):
    """What answers there can't prove that it is the robot: its certificate is another's, or has ended."""

    kind = "not_trusted"
    advice = "Type: robotctl login, with what this robot's keeper gave you; if you have, ask them"


class Overloaded(Refused):
    """The gateway has no room for this client or for so many requests."""

    kind = "overloaded"
    advice = "Wait a little and ask less often"


class InvalidRequest(GatewayError):
    """The request itself is wrong; nothing changed on the robot."""

    kind = "invalid_request"
    advice = "Correct the request; this client may be newer or older than the gateway"


class Unsupported(GatewayError):
    """The gateway doesn't know the method: it is older than this client."""

    kind = "unsupported"
    advice = "Update the gateway, or use the client of the gateway's version"


class GatewayFailed(GatewayError):
    """The gateway met an error of its own, or sent what this client can't read."""

    kind = "gateway_failed"


class Cancelled(GatewayError):
    """The call was given up before an answer came: by this program, or because the client was closed."""

    kind = "cancelled"
    advice = "Open a new client and ask again"
