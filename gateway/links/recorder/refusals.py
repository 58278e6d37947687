"""What the recorder refuses, as an error for the gateway's own callers."""

import logging
from collections.abc import Callable, Mapping
from typing import Final

import grpc

from common.errors import (
    ConflictError,
    DamagedError,
    DefectError,
    DomainError,
    InvalidRequestError,
    NotFoundError,
    PreconditionError,
    RecorderUnreachableError,
    TooMuchError,
)
from common.reasons import Reason
from common.refusal import refusal_in
from gateway.links.grpc_client import GONE

_log = logging.getLogger(__name__)

_REFUSALS: Final[Mapping[grpc.StatusCode, tuple[Callable[[str, Reason], DomainError], Reason]]] = {
    grpc.StatusCode.NOT_FOUND: (NotFoundError, Reason.RECORDING_NOT_FOUND),
    grpc.StatusCode.FAILED_PRECONDITION: (PreconditionError, Reason.RECORDER_NOT_READY),
    grpc.StatusCode.ABORTED: (ConflictError, Reason.RECORDING_CHANGED),
    grpc.StatusCode.RESOURCE_EXHAUSTED: (TooMuchError, Reason.DISK_FULL),
    grpc.StatusCode.INVALID_ARGUMENT: (lambda text, _: InvalidRequestError(text), Reason.INVALID_REQUEST),
    grpc.StatusCode.DATA_LOSS: (lambda text, _: DamagedError(text), Reason.RECORDING_DAMAGED),
}
"""By code: the error, and the reason where the recorder gives none that this gateway knows."""


def unreachable(why: str) -> RecorderUnreachableError:
    """Returns the error of a recorder that does not answer."""
    return RecorderUnreachableError(
        f"the robot's recorder does not answer ({why}); what it records at present goes on"
    )


def refused(error: grpc.aio.AioRpcError) -> DomainError:
    """Returns the error for the caller of a method that the recorder has not carried out."""
    code, text = error.code(), error.details() or error.code().name
    if code in GONE:
        return unreachable("it is gone, or took too long")
    if code not in _REFUSALS:
        _log.error("the recorder failed: %s %s", code.name, text)
        return DefectError("the robot's recorder failed; see its log")
    kind, reason = _REFUSALS[code]
    found = refusal_in(error.trailing_metadata())
    refusal = kind(text, Reason(found.reason) if found.reason in set(Reason) else reason)
    refusal.retry_after_s = found.retry_after_s
    return refusal
