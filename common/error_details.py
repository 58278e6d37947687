"""Encodes errors as google.rpc.Status in trailing metadata: reason, field violations and retry delay."""

from typing import Final

import grpc
from google.rpc.error_details_pb2 import BadRequest, ErrorInfo, RetryInfo
from google.rpc.status_pb2 import Status
from grpc_status.rpc_status import to_status

from common.errors import DomainError
from common.reasons import Reason

DOMAIN: Final = "omniseer.gateway.v1"
"""The namespace of the reasons, as google.rpc.ErrorInfo requires."""
_NS_PER_S: Final = 1_000_000_000


def metadata_of(error: DomainError, code: grpc.StatusCode) -> tuple[tuple[str, str | bytes], ...]:
    """Returns the trailing metadata that accompanies the code and text of a domain error."""
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


def metadata_of_defect(text: str) -> tuple[tuple[str, str | bytes], ...]:
    """Returns the trailing metadata of an internal error, which reveals nothing of its cause."""
    return _metadata(_status(grpc.StatusCode.INTERNAL, text, Reason.INTERNAL))


def _status(code: grpc.StatusCode, text: str, reason: Reason) -> Status:
    number: int = code.value[0]
    status = Status(code=number, message=text)
    status.details.add().Pack(ErrorInfo(reason=reason.value, domain=DOMAIN))
    return status


def _metadata(status: Status) -> tuple[tuple[str, str | bytes], ...]:
    return tuple(to_status(status).trailing_metadata)
