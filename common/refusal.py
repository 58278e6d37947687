"""The error details of a refusal: reason, invalid fields, retry delay (google.rpc.Status)."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

from google.protobuf.message import DecodeError
from google.rpc.error_details_pb2 import BadRequest, ErrorInfo, RetryInfo
from google.rpc.status_pb2 import Status

DOMAIN: Final = "omniseer.gateway.v1"
"""The `domain` of google.rpc.ErrorInfo: who defines the reasons. Those of a proxy have another."""
_KEY: Final = "grpc-status-details-bin"
_NS_PER_S: Final = 1_000_000_000
_LONGEST_S: Final = 365 * 86_400
"""A delay beyond it is no help; time.sleep() and asyncio.sleep() take it."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """The details; empty where an older program, or gRPC itself, refused."""

    reason: str = ""
    fields: tuple[str, ...] = ()
    retry_after_s: float | None = None


def refusal_in(metadata: Iterable[Any] | None) -> Refusal:
    """Returns the details in the trailing metadata of a failed call; unreadable ones count as absent."""
    data = next((value for key, value in metadata or () if key == _KEY), b"")
    status, info, request, retry = Status(), ErrorInfo(), BadRequest(), RetryInfo()
    retry_after_s: float | None = None
    try:
        status.MergeFromString(data)
        for detail in status.details:
            if detail.Unpack(retry):
                delay_s = retry.retry_delay.ToNanoseconds() / _NS_PER_S
                retry_after_s = delay_s if 0 <= delay_s <= _LONGEST_S else None
            elif not detail.Unpack(info):
                detail.Unpack(request)
    except DecodeError:
        return Refusal()
    return Refusal(
        reason=info.reason if info.domain == DOMAIN else "",
        fields=tuple(violation.field for violation in request.field_violations),
        retry_after_s=retry_after_s,
    )
