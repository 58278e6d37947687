"""What can't be reconciled: the operators' calls, which the recorder answers, and reports of faults."""

from collections.abc import AsyncGenerator, Mapping
from contextlib import aclosing
from typing import Final

from common.errors import DamagedError
from common.open_file import Chunk, UnreadableError
from gateway.links.grpc_client import call_metadata
from gateway.links.recorder.refusals import REFUSALS
from gateway.links.recorder.wire import RecorderClient
from gateway.links.watch import SharingConnector
from gateway.status.cloud import CopyReport
from gateway.status.fault import Condition

_ANSWER_WITHIN_S: Final = 5.0
_LONGER_S: Final[Mapping[str, float]] = {"StartRecording": 10.0, "StopRecording": 12.0}
"""Methods that wait for the disk: a stop answers after 10 s while its files are still being finalised."""


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
        with REFUSALS.calling(self._client) as recorder:
            return await recorder.call(method, request, timeout_s, call_metadata(caller))

    async def export(self, request: bytes, caller: str) -> AsyncGenerator[bytes | Chunk]:
        """Passes an export on: yields its responses, serialised, or chunks of the file, each as it is taken.

        Raises:
            DomainError: the recorder refuses, or is gone.
        """
        try:
            with REFUSALS.calling(self._client) as recorder:
                async with aclosing(recorder.export(request, call_metadata(caller))) as responses:
                    async for response in responses:
                        yield response
        except UnreadableError as error:
            raise DamagedError(f"the file on the robot: {error}") from error

    async def report_fault(self, fault: Condition) -> str:
        """Reports a fault; returns the incident that it became, empty for none.

        Raises:
            DomainError: the recorder refuses, or does not answer.
        """
        with REFUSALS.calling(self._client) as recorder:
            return await recorder.report_fault(
                fault.fault_id, fault.severity, fault.message, _ANSWER_WITHIN_S
            )

    async def set_copy(self, report: CopyReport) -> None:
        """Reports the state of a copy, which the recorder keeps for its retention and for operators.

        Raises:
            DomainError: the recorder refuses, or does not answer.
        """
        with REFUSALS.calling(self._client) as recorder:
            await recorder.set_copy(report, _ANSWER_WITHIN_S)
