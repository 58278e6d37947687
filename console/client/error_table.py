"""Two total tables: what each gRPC code, and each reason of a gateway, means to someone who asked a robot."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, Final, Protocol, cast

import grpc

from common.reasons import Reason
from console.client.errors import (
    Cancelled,
    DeadlineExceeded,
    GatewayError,
    GatewayFailed,
    InvalidRequest,
    NotAllowed,
    NotTrusted,
    Overloaded,
    Refused,
    Unreachable,
    Unsupported,
)
from console.client.refusal import refusal_in

ERRORS: Final[Mapping[grpc.StatusCode, type[GatewayError]]] = MappingProxyType(
    {
        # An error that carries OK is itself out of order.
        grpc.StatusCode.OK: GatewayFailed,
        grpc.StatusCode.CANCELLED: Cancelled,
        grpc.StatusCode.UNKNOWN: GatewayFailed,
        grpc.StatusCode.INVALID_ARGUMENT: InvalidRequest,
        grpc.StatusCode.DEADLINE_EXCEEDED: DeadlineExceeded,
        grpc.StatusCode.NOT_FOUND: Refused,
        grpc.StatusCode.ALREADY_EXISTS: Refused,
        grpc.StatusCode.PERMISSION_DENIED: NotAllowed,
        grpc.StatusCode.RESOURCE_EXHAUSTED: Overloaded,
        grpc.StatusCode.FAILED_PRECONDITION: Refused,
        grpc.StatusCode.ABORTED: Refused,
        grpc.StatusCode.OUT_OF_RANGE: InvalidRequest,
        grpc.StatusCode.UNIMPLEMENTED: Unsupported,
        grpc.StatusCode.INTERNAL: GatewayFailed,
        grpc.StatusCode.UNAVAILABLE: Unreachable,
        grpc.StatusCode.DATA_LOSS: GatewayFailed,
        grpc.StatusCode.UNAUTHENTICATED: NotAllowed,
    }
)

REASONS: Final[Mapping[str, type[GatewayError]]] = MappingProxyType(
    {
        Reason.INVALID_REQUEST: InvalidRequest,
        Reason.MESSAGE_TOO_LARGE: InvalidRequest,
        Reason.UNKNOWN_SERVICE: Refused,
        Reason.TOO_MANY_CONNECTIONS: Overloaded,
        Reason.TOO_MANY_STREAMS: Overloaded,
        Reason.TOO_MANY_REQUESTS: Overloaded,
        Reason.CREDENTIAL_MISSING: NotAllowed,
        Reason.CREDENTIAL_UNKNOWN: NotAllowed,
        Reason.CREDENTIAL_REVOKED: NotAllowed,
        Reason.CREDENTIAL_EXPIRED: NotAllowed,
        Reason.CREDENTIAL_NOT_YET_VALID: NotAllowed,
        Reason.ROLE_TOO_LOW: NotAllowed,
        Reason.LOCKED_OUT: NotAllowed,
        Reason.INTERNAL: GatewayFailed,
    }
)
"""Total. What a gateway says counts more than the code; a word of a newer one leaves the code to speak."""

_ADVICE: Final[Mapping[str, str]] = MappingProxyType(
    {
        Reason.TOO_MANY_CONNECTIONS: "Close a program that watches this robot, or wait a little",
        Reason.TOO_MANY_STREAMS: "Close a stream of this program, or share one",
        Reason.CREDENTIAL_EXPIRED: "Ask whoever keeps this robot for a new login, then type: robotctl login",
        Reason.ROLE_TOO_LOW: (
            "Ask whoever keeps this robot for a login with that role, then type: robotctl login"
        ),
        Reason.LOCKED_OUT: "Wait as long as it says; if the stored login is an old one, type: robotctl login",
    }
)
"""Where a reason lets us say more than the family's own advice does."""

_CLOSED: Final = "the connection was closed, as by a gateway that wants to know who asks (robotctl login)"

# gRPC's words for a dead link, and ours. They only shorten the line: unknown wording is printed as it came.
_PLAIN_WORDS: Final = (
    ("before receiving settings", "something listens there, but it does not answer as a gateway"),
    ("connection refused", "nothing listens there"),
    ("dns resolution failed", "the name does not resolve"),
    ("dns query cancelled", "the name does not resolve"),
    ("domain name not found", "the name does not resolve"),
    ("wrong_version_number", "what listens there does not speak TLS"),
    ("keepalive", "the link went silent"),
    ("ping timeout", "the link went silent"),
    ("no route to host", "no route to this host"),
    ("network is unreachable", "no network leads there"),
    ("fd shutdown", "no answer"),
    ("handshaker shutdown", "no answer"),
    ("timeout occurred", "no answer"),
    ("timed out", "no answer"),
    ("socket closed", _CLOSED),
    ("connection reset", _CLOSED),
    ("failed parsing http/2", "what listens there does not speak gRPC"),
)
_NOT_TRUSTED: Final = (
    ("certificate has expired", "its certificate has ended"),
    ("certificate is not yet valid", "its certificate is not valid yet, by this computer's clock"),
    ("hostname verification", "its certificate is for other names than this one"),
    ("certificate_verify_failed", "its certificate was not signed by the authority of this robot's login"),
)
"""The same for a connection that was encrypted and then given up, because of whom it led to."""


class _Coded(Protocol):
    """What the errors of both flavours of gRPC carry; they share no class that says so."""

    def code(self) -> grpc.StatusCode: ...

    def details(self) -> str | None: ...

    def trailing_metadata(self) -> Iterable[Any] | None: ...


def error_from(failure: grpc.RpcError, target: str, timeout_s: float) -> GatewayError:
    """The family member for a failed call.

    Args:
        failure: what gRPC raised; it carries a code and details.
        target: the robot's address, for the message.
        timeout_s: how long the call was allowed to take.
    """
    coded = cast("_Coded", failure)
    code, refusal = coded.code(), refusal_in(coded.trailing_metadata())
    details = coded.details() or code.name
    if code is grpc.StatusCode.UNAVAILABLE and (why := _words_for(details, _NOT_TRUSTED)):
        return NotTrusted(f"what answers at {target} is not trusted: {why}")
    family = REASONS.get(refusal.reason, ERRORS[code])
    error = family(_sentence(family, details, target, timeout_s), _ADVICE.get(refusal.reason))
    error.reason, error.fields, error.retry_after_s = refusal.reason, refusal.fields, refusal.retry_after_s
    return error


def stream_error_from(error: GatewayError | None, target: str) -> GatewayError:
    """Why a stream ended that nobody here has ended.

    Args:
        error: what its call ended with; None for an end in good order.
        target: the robot's address, for the message.
    """
    if error is None or isinstance(error, Cancelled):
        # A gateway that stops ends its streams, by a good end or by cancelling them.
        return Unreachable(f"no robot gateway reached at {target}: it ended the stream")
    return error


def _sentence(family: type[GatewayError], details: str, target: str, timeout_s: float) -> str:
    if family is Unreachable:
        return f"no robot gateway reached at {target}: {_in_plain_words(details)}"
    if family is DeadlineExceeded:
        return f"the robot gateway at {target} did not answer within {timeout_s:.1f} s"
    if issubclass(family, Refused | InvalidRequest):
        return f"the robot gateway at {target} refused: {details}"
    return f"the call to the robot gateway at {target} failed: {details}"


def _in_plain_words(details: str) -> str:
    return _words_for(details, _PLAIN_WORDS) or details


def _words_for(details: str, table: tuple[tuple[str, str], ...]) -> str:
    lowered = details.lower()
    return next((plain for fragment, plain in table if fragment in lowered), "")
