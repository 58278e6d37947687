"""A refusal for programs: google.rpc.Status with reason, fields and when to try again, in gRPC's metadata."""

from typing import Final

import grpc
from google.rpc.error_details_pb2 import BadRequest, ErrorInfo, RetryInfo
from google.rpc.status_pb2 import Status
from grpc_status.rpc_status import to_status

from common.errors import DomainError
from common.reasons import Reason

DOMAIN: Final = "omniseer.gateway.v1"
"""Whose reasons these are."""
_NS_PER_S: Final = 1_000_000_000


def metadata_of(error: DomainError, code: grpc.StatusCode) -> tuple[tuple[str, str | bytes], ...]:
    """What is sent along with the code and the error's own words."""
    status = _status(code, str(error), error.reason)
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
    return _metadata(status)


def metadata_of_defect(words: str) -> tuple[tuple[str, str | bytes], ...]:
    """The same for an error of our own, of which the caller learns nothing."""
    return _metadata(_status(grpc.StatusCode.INTERNAL, words, Reason.INTERNAL))


def _status(code: grpc.StatusCode, words: str, reason: Reason) -> Status:
    number: int = code.value[0]
    status = Status(code=number, message=words)
    status.details.add().Pack(ErrorInfo(reason=reason.value, domain=DOMAIN))
    return status


def _metadata(status: Status) -> tuple[tuple[str, str | bytes], ...]:
    return tuple(to_status(status).trailing_metadata)
