"""Domain errors as gRPC statuses: the code, and google.rpc.Status with reason, fields and retry delay."""

import asyncio
import logging
from collections.abc import Mapping
from typing import Final

import grpc
from google.rpc.error_details_pb2 import BadRequest, ErrorInfo, RetryInfo
from google.rpc.status_pb2 import Status
from grpc_status.rpc_status import to_status

from common.errors import (
    BridgeUnreachableError,
    ConflictError,
    DamagedError,
    DefectError,
    DomainError,
    DriveUnreachableError,
    InvalidRequestError,
    NotAllowedError,
    NotAuthenticatedError,
    NotFoundError,
    NotRunningError,
    PreconditionError,
    RecorderUnreachableError,
    TooMuchError,
    UnknownServiceError,
)
from common.interceptors import Call, Interceptor
from common.refusal import DOMAIN

_log = logging.getLogger(__name__)

STATUS_CODES: Final[Mapping[type[DomainError], grpc.StatusCode]] = {
    InvalidRequestError: grpc.StatusCode.INVALID_ARGUMENT,
    NotAuthenticatedError: grpc.StatusCode.UNAUTHENTICATED,
    NotAllowedError: grpc.StatusCode.PERMISSION_DENIED,
    NotRunningError: grpc.StatusCode.FAILED_PRECONDITION,
    PreconditionError: grpc.StatusCode.FAILED_PRECONDITION,
    ConflictError: grpc.StatusCode.ABORTED,
    DriveUnreachableError: grpc.StatusCode.UNAVAILABLE,
    RecorderUnreachableError: grpc.StatusCode.UNAVAILABLE,
    BridgeUnreachableError: grpc.StatusCode.UNAVAILABLE,
    TooMuchError: grpc.StatusCode.RESOURCE_EXHAUSTED,
    UnknownServiceError: grpc.StatusCode.NOT_FOUND,
    NotFoundError: grpc.StatusCode.NOT_FOUND,
    DamagedError: grpc.StatusCode.DATA_LOSS,
    DefectError: grpc.StatusCode.INTERNAL,
}
"""Total: a test walks the subclasses of DomainError. Every other exception is a defect, so INTERNAL."""
_NS_PER_S: Final = 1_000_000_000


class ErrorInterceptor(Interceptor[Call]):
    """Ends a call whose handler raised with the status of the error. The outermost interceptor.

    An exception that is no DomainError is a defect of ours: it is logged with its traceback, and the caller
    gets INTERNAL without any detail of it.
    """

    async def on_error(self, call: Call, error: BaseException) -> None:
        """Aborts the call, which raises grpc.aio.AbortError, unless that, or the caller, ended it."""
        if isinstance(error, grpc.aio.AbortError) or not isinstance(error, Exception):
            return
        if not isinstance(error, DomainError):
            _log.error("%s failed", call.method.path, exc_info=error)
            error = DefectError("internal error; see the robot's log")
        code = status_code(error, call)
        await call.rpc.abort(code, str(error), metadata_of(error, code))


def status_code(error: BaseException | None, call: Call) -> grpc.StatusCode:
    """Returns the code that a call ends with, given what ended it (see `Interceptor.on_end`)."""
    if error is None:
        return grpc.StatusCode.OK
    if isinstance(error, asyncio.CancelledError):
        return grpc.StatusCode.CANCELLED
    if isinstance(error, grpc.aio.AbortError):
        return call.rpc.code()
    if isinstance(error, DomainError):
        return STATUS_CODES.get(type(error), grpc.StatusCode.INTERNAL)
    return grpc.StatusCode.INTERNAL


def metadata_of(error: DomainError, code: grpc.StatusCode) -> tuple[tuple[str, str | bytes], ...]:
    """Returns the trailing metadata that carries the error's details for programs."""
    number: int = code.value[0]
    status = Status(code=number, message=str(error))
    status.details.add().Pack(ErrorInfo(reason=error.reason.value, domain=DOMAIN))
    if error.violations:
        fields = [
            BadRequest.FieldViolation(field=each.field, description=each.description)
            for each in error.violations
        ]
        status.details.add().Pack(BadRequest(field_violations=fields))
    if error.retry_after_s is not None:
        retry = RetryInfo()
        retry.retry_delay.FromNanoseconds(round(error.retry_after_s * _NS_PER_S))
        status.details.add().Pack(retry)
    return tuple(to_status(status).trailing_metadata)
