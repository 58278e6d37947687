"""Maps gRPC codes and the gateway's reasons to the client's exceptions. Both tables are total."""

from collections.abc import Mapping
from typing import Any, Final

import grpc

from common.printable import printable
from common.reasons import Reason
from common.refusal import refusal_in
from console.client import errors

ERRORS: Final[Mapping[grpc.StatusCode, type[errors.GatewayError]]] = {
    # An error with the code OK is a defect of the server.
    grpc.StatusCode.OK: errors.GatewayFailed,
    # A gateway that stops, or has too many calls. One that this client cancels itself has no code.
    grpc.StatusCode.CANCELLED: errors.Unreachable,
    grpc.StatusCode.UNKNOWN: errors.GatewayFailed,
    grpc.StatusCode.INVALID_ARGUMENT: errors.InvalidRequest,
    grpc.StatusCode.DEADLINE_EXCEEDED: errors.DeadlineExceeded,
    grpc.StatusCode.NOT_FOUND: errors.Refused,
    grpc.StatusCode.ALREADY_EXISTS: errors.Refused,
    grpc.StatusCode.PERMISSION_DENIED: errors.NotAllowed,
    grpc.StatusCode.RESOURCE_EXHAUSTED: errors.Overloaded,
    grpc.StatusCode.FAILED_PRECONDITION: errors.Refused,
    grpc.StatusCode.ABORTED: errors.Refused,
    grpc.StatusCode.OUT_OF_RANGE: errors.InvalidRequest,
    grpc.StatusCode.UNIMPLEMENTED: errors.Unsupported,
    grpc.StatusCode.INTERNAL: errors.GatewayFailed,
    grpc.StatusCode.UNAVAILABLE: errors.Unreachable,
    grpc.StatusCode.DATA_LOSS: errors.GatewayFailed,
    grpc.StatusCode.UNAUTHENTICATED: errors.NotAllowed,
}

REASONS: Final[Mapping[str, type[errors.GatewayError]]] = {
    Reason.INVALID_REQUEST: errors.InvalidRequest,
    Reason.PREVIEW_NOT_RUNNING: errors.Refused,
    Reason.TELEOP_NOT_CONFIGURED: errors.Refused,
    Reason.TELEOP_DISABLED: errors.Refused,
    Reason.SUPERVISION_NOT_PERMITTED: errors.Refused,
    Reason.LEASE_HELD: errors.Refused,
    Reason.LEASE_LOST: errors.Refused,
    Reason.DRIVE_UNREACHABLE: errors.Refused,
    Reason.STOP_NOT_RESET: errors.Refused,
    Reason.RECORDING_NOT_CONFIGURED: errors.Refused,
    Reason.RECORDER_UNREACHABLE: errors.Refused,
    Reason.RECORDER_NOT_READY: errors.Refused,
    Reason.RECORDING_NOT_FOUND: errors.Refused,
    Reason.RECORDING_RUNS: errors.Refused,
    Reason.NO_VIDEO: errors.Refused,
    Reason.NO_RING: errors.Refused,
    Reason.DISK_FULL: errors.Refused,
    Reason.TOO_MANY_SNAPSHOTS: errors.Overloaded,
    Reason.TOO_MANY_EXPORTS: errors.Overloaded,
    Reason.EXPORT_STALLED: errors.Overloaded,
    Reason.FILE_NOT_FINAL: errors.Refused,
    Reason.RECORDING_CHANGED: errors.Refused,
    Reason.RECORDING_DELETED: errors.Refused,
    Reason.RECORDING_DAMAGED: errors.Refused,
    Reason.RECORDING_READ_ONLY: errors.Refused,
    Reason.RECORDING_PINNED: errors.Refused,
    Reason.RECORDING_NOT_COPIED: errors.Refused,
    Reason.FLEET_NOT_CONFIGURED: errors.Refused,
    Reason.BRIDGE_UNREACHABLE: errors.Refused,
    Reason.UPLOAD_NOT_QUEUED: errors.Refused,
    Reason.TOO_MANY_UPLOADS: errors.Overloaded,
    Reason.MESSAGE_TOO_LARGE: errors.InvalidRequest,
    Reason.UNKNOWN_SERVICE: errors.Refused,
    Reason.TOO_MANY_CONNECTIONS: errors.Overloaded,
    Reason.TOO_MANY_STREAMS: errors.Overloaded,
    Reason.TOO_MANY_REQUESTS: errors.Overloaded,
    Reason.CREDENTIAL_MISSING: errors.NotAllowed,
    Reason.CREDENTIAL_UNKNOWN: errors.NotAllowed,
    Reason.CREDENTIAL_REVOKED: errors.NotAllowed,
    Reason.CREDENTIAL_EXPIRED: errors.NotAllowed,
    Reason.CREDENTIAL_NOT_YET_VALID: errors.NotAllowed,
    Reason.CREDENTIALS_UNREADABLE: errors.NotAllowed,
    Reason.ROLE_TOO_LOW: errors.NotAllowed,
    Reason.LOCKED_OUT: errors.NotAllowed,
    Reason.INTERNAL: errors.GatewayFailed,
}
"""A reason takes precedence over the code; an unknown one, of a newer gateway, leaves it to that."""

_NEW_LOGIN: Final = (
    "Ask this robot's administrator for a new login, then type: robotctl login NAME HOST:PORT FILE --replace"
)
_ADVICE: Final[Mapping[str, str]] = {
    Reason.TOO_MANY_CONNECTIONS: "Close another program that is connected to this robot, or wait",
    Reason.TOO_MANY_STREAMS: "Close a stream of this program, or share one",
    Reason.CREDENTIAL_UNKNOWN: _NEW_LOGIN,
    Reason.CREDENTIAL_REVOKED: _NEW_LOGIN,
    Reason.CREDENTIAL_EXPIRED: _NEW_LOGIN,
    Reason.TELEOP_DISABLED: "Enable driving first",
    Reason.LEASE_HELD: "Wait, or take over",
    Reason.RECORDING_NOT_CONFIGURED: "Ask this robot's administrator to set it up; see docs/recording.md",
    Reason.RECORDER_UNREACHABLE: "Start or restart robot-recorder on the robot; what it records goes on",
    Reason.RECORDER_NOT_READY: "Type: robotctl status",
    Reason.RECORDING_NOT_FOUND: "Type: robotctl record list",
    Reason.RECORDING_RUNS: "Wait until it ends, or type: robotctl record stop",
    Reason.NO_VIDEO: "Record without the video",
    Reason.NO_RING: "Set `ring` in the recorder's configuration",
    Reason.DISK_FULL: "Copy recordings to this computer and delete them: robotctl record list",
    Reason.TOO_MANY_SNAPSHOTS: "Wait until they are complete: robotctl record list",
    Reason.TOO_MANY_EXPORTS: "Wait until another export has ended",
    Reason.EXPORT_STALLED: "Go on where it ended; read faster, or set a limit",
    Reason.FILE_NOT_FINAL: "Wait until the recorder has begun its next file, or type: robotctl record stop",
    Reason.RECORDING_CHANGED: "Type: robotctl record show ID",
    Reason.RECORDING_DELETED: "Type: robotctl record list",
    Reason.RECORDING_DAMAGED: "Check the robot's disk; the recording's other files may be intact",
    Reason.RECORDING_READ_ONLY: "Change it on the robot itself",
    Reason.RECORDING_PINNED: "Unpin it, or as an administrator delete it with force",
    Reason.RECORDING_NOT_COPIED: "Wait until it is copied, or as an administrator delete it with force",
    Reason.FLEET_NOT_CONFIGURED: "Ask this robot's administrator to set it up; see docs/fleet.md",
    Reason.BRIDGE_UNREACHABLE: "Start or restart robot-bridge on the robot; recordings stay there",
    Reason.UPLOAD_NOT_QUEUED: "Type: robotctl record list",
    Reason.TOO_MANY_UPLOADS: "Wait until some are copied, or type: robotctl record cancel-upload ID",
    Reason.CREDENTIALS_UNREADABLE: (
        "Ask this robot's administrator to repair its list of credentials; no new login is needed"
    ),
    Reason.ROLE_TOO_LOW: (
        "Ask this robot's administrator for a login with that role, then type: "
        "robotctl login NAME HOST:PORT FILE --replace"
    ),
    Reason.LOCKED_OUT: (
        "Wait as long as it says; if the stored login is outdated, store the new one: "
        "robotctl login NAME HOST:PORT FILE --replace"
    ),
}
"""Where a reason allows more specific advice than the class. Scripts and windows show it as well: what an
argument of the library does has an option of robotctl, which console/cli/refusal_commands.py names."""

_CLOSED: Final = "the connection was closed, as by a gateway that requires a login (robotctl login)"

# gRPC's messages about a connection, and plainer ones. Unknown messages are passed on unchanged.
_PLAIN_MESSAGES: Final = (
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
    ("certificate has expired", "its certificate has expired"),
    ("certificate is not yet valid", "its certificate is not valid yet, by this computer's clock"),
    ("hostname verification", "its certificate is for other names than this one"),
    (
        "certificate_verify_failed",
        "its certificate was not signed by the certificate authority of this robot's login",
    ),
)
"""The same for a TLS handshake that failed because of the server's certificate."""


def error_from(failure: grpc.RpcError, target: str, timeout_s: float) -> errors.GatewayError:
    """Returns the exception for a failed call.

    Args:
        failure: Raised by gRPC; it carries a code and details.
        target: The robot's address, for the message.
        timeout_s: The deadline of the call.
    """
    # Both gRPC APIs raise errors with these methods, but share no class that declares them.
    call: Any = failure
    code, refusal = call.code(), refusal_in(call.trailing_metadata())
    details = printable(call.details() or code.name)
    if code is grpc.StatusCode.UNAVAILABLE and (why := _message_for(details, _NOT_TRUSTED)):
        return errors.NotTrusted(f"what answers at {target} is not trusted: {why}")
    if code is grpc.StatusCode.CANCELLED:
        return ERRORS[code](
            f"the robot gateway at {target} cancelled the call: it stops, or has more calls than it can take",
            "Try again",
        )
    family = REASONS.get(refusal.reason, ERRORS[code])
    error = family(_sentence(family, details, target, timeout_s), _ADVICE.get(refusal.reason))
    error.reason, error.retry_after_s = printable(refusal.reason), refusal.retry_after_s
    error.fields = tuple(map(printable, refusal.fields))
    return error


def _sentence(family: type[errors.GatewayError], details: str, target: str, timeout_s: float) -> str:
    if family is errors.Unreachable:
        return f"no robot gateway reached at {target}: {_message_for(details, _PLAIN_MESSAGES) or details}"
    if family is errors.DeadlineExceeded:
        return f"the robot gateway at {target} did not answer within {timeout_s:.1f} s"
    if issubclass(family, errors.Refused | errors.InvalidRequest):
        return f"the robot gateway at {target} refused: {details}"
    return f"the call to the robot gateway at {target} failed: {details}"


def _message_for(details: str, table: tuple[tuple[str, str], ...]) -> str:
    lowered = details.lower()
    return next((plain for fragment, plain in table if fragment in lowered), "")
