"""What a service refuses, as an error for the gateway's own callers."""

import asyncio
import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final, TypeAlias, TypeVar

import grpc

from common.errors import DefectError, DomainError, InvalidRequestError, NotFoundError
from common.reasons import Reason
from common.refusal import refusal_in
from gateway.links.grpc_client import GONE, is_cancelled
from gateway.links.watch import ABSENT

_log = logging.getLogger(__name__)

ClientT = TypeVar("ClientT")
ByCode: TypeAlias = Mapping[grpc.StatusCode, tuple[Callable[[str, Reason], DomainError], Reason]]

OF_ANY_SERVICE: Final[ByCode] = {
    grpc.StatusCode.NOT_FOUND: (NotFoundError, Reason.RECORDING_NOT_FOUND),
    grpc.StatusCode.INVALID_ARGUMENT: (lambda text, _: InvalidRequestError(text), Reason.INVALID_REQUEST),
}
"""What services with recordings refuse alike."""


@dataclass(frozen=True, slots=True)
class Refusals:
    """The refusals of one service.

    Attributes:
        name: of the service, for people.
        by_code: the error, and the reason where the service gives none that this gateway knows.
        unreachable: makes the error of a service that does not answer, from why.
    """

    name: str
    by_code: ByCode
    unreachable: Callable[[str], DomainError]

    def refused(self, error: grpc.aio.AioRpcError) -> DomainError:
        """Returns the error for the caller of a method that the service has not carried out."""
        code, text = error.code(), error.details() or error.code().name
        if code in GONE:
            return self.unreachable("it is gone, or took too long")
        if code not in self.by_code:
            _log.error("%s failed: %s %s", self.name, code.name, text)
            return DefectError(f"{self.name} failed; see its log")
        kind, reason = self.by_code[code]
        found = refusal_in(error.trailing_metadata())
        refusal = kind(text, Reason(found.reason) if found.reason in set(Reason) else reason)
        refusal.retry_after_s = found.retry_after_s
        return refusal

    @contextmanager
    def calling(self, client: ClientT | None) -> Iterator[ClientT]:
        """Yields the client of the present connection. A task that is cancelled stays cancelled.

        Raises:
            DomainError: there is no connection, or a call of the block has failed.
        """
        if client is None:
            raise self.unreachable(ABSENT)
        try:
            yield client
        except grpc.aio.AioRpcError as error:
            raise self.refused(error) from None
        except asyncio.CancelledError:
            if is_cancelled():
                raise
            raise self.unreachable(ABSENT) from None
