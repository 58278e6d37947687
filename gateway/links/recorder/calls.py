"""What can't be reconciled: the operators' calls, which the recorder answers, and reports of faults."""

import asyncio
from collections.abc import AsyncGenerator, Iterator, Mapping
from contextlib import contextmanager
from typing import Final

import grpc

from common import request_id
from gateway.links.recorder.refusals import refused, unreachable
from gateway.links.recorder.wire import RecorderClient
from gateway.links.watch import ABSENT, SharingConnector
from gateway.status.fault import Condition

_ANSWER_WITHIN_S: Final = 5.0
_LONGER_S: Final[Mapping[str, float]] = {"StartRecording": 10.0, "StopRecording": 12.0}
"""Methods that wait for the disk: a stop answers after 10 s while its files are still being finalised."""
_CALLER: Final = "x-caller"
"""Metadata: who calls, for people."""


class RecorderCalls(SharingConnector[RecorderClient]):
    """A connector for the link that uses its connection for the operators' calls as well."""

    async def call(self, method: str, request: bytes, caller: str, remaining_s: float | None) -> bytes:
        """Passes a unary call on, and returns the response, both serialised.

        Args:
            method: its name, which both contracts share.
            request: the operator's.
            caller: for people.
            remaining_s: until the caller's deadline; None without one.

        Raises:
            DomainError: the recorder refuses, or does not answer.
        """
        timeout_s = _LONGER_S.get(method, _ANSWER_WITHIN_S)
        if remaining_s is not None:
            timeout_s = min(timeout_s, remaining_s)
        with _domain_errors():
            return await self._connected().call(method, request, timeout_s, _metadata(caller))

    async def export(self, request: bytes, caller: str) -> AsyncGenerator[bytes]:
        """Passes an export on: yields its responses, serialised, each as it is taken.

        Raises:
            DomainError: the recorder refuses, or is gone.
        """
        stream = self._connected().export(request, _metadata(caller))
        try:
            with _domain_errors():
                async for response in stream:
                    yield response
        finally:
            stream.cancel()

    async def report_fault(self, fault: Condition) -> str:
        """Reports a fault; returns the incident that it became, empty for none.

        Raises:
            DomainError: the recorder refuses, or does not answer.
        """
        with _domain_errors():
            return await self._connected().report_fault(
                fault.fault_id, fault.severity, fault.message, _ANSWER_WITHIN_S
            )

    def _connected(self) -> RecorderClient:
        if self._client is None:
            raise unreachable(ABSENT)
        return self._client


def _metadata(caller: str) -> tuple[tuple[str, str], ...]:
    return (request_id.HEADER, request_id.current()), (_CALLER, caller)


@contextmanager
def _domain_errors() -> Iterator[None]:
    """Turns the errors of a call into the gateway's own; a task that is cancelled stays cancelled."""
    try:
        yield
    except grpc.aio.AioRpcError as error:
        raise refused(error) from None
    except asyncio.CancelledError:
        if _is_cancelled():
            raise
        raise unreachable(ABSENT) from None


def _is_cancelled() -> bool:
    """Whether this task is cancelled: gRPC raises the same when the link closes the channel under a call."""
    task = asyncio.current_task()
    return bool(task and task.cancelling())
