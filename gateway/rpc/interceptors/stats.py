"""Counts and times every call, also those that an inner interceptor refuses; counts who calls."""

import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import grpc

from common.errors import DomainError
from common.grpc_errors import status_code
from common.histogram import Histogram
from common.interceptors import Interceptor
from gateway.rpc.calls.call import CallContext

RECENT_S: Final = 10.0
"""A connection that called, or was sent something, this recently counts as a client."""
_MAX_CONNECTIONS: Final = 1024
"""Beyond it, the connection that was quiet longest is forgotten."""
_OK: Final = grpc.StatusCode.OK.name
_BOUNDS_S: Final = (0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0)
"""Upper bounds of the duration histogram's buckets."""


@dataclass(slots=True)
class MethodStats:
    """The calls of one method since the start.

    Attributes:
        served: answered; a stream counts when its first response leaves.
        refused: ended by a DomainError.
        failed: ended by a defect of ours.
        open: streams that last.
        ended: calls by gRPC code ("OK").
        durations: seconds from arrival to end.
    """

    served: int = 0
    refused: int = 0
    failed: int = 0
    open: int = 0
    ended: Counter[str] = field(default_factory=Counter)
    durations: Histogram = field(default_factory=lambda: Histogram(_BOUNDS_S))


class Stats(Interceptor[CallContext]):
    """Statistics of all calls. Only methods that exist are called, so there are few names.

    Args:
        contract_methods: have statistics also before their first call.
        clock: seconds, monotonic.
    """

    def __init__(
        self, contract_methods: Iterable[str] = (), clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._clock = clock
        self.contract = {name: MethodStats() for name in contract_methods}
        """The methods of the contract, by `Method.key`."""
        self._others: dict[str, MethodStats] = {}
        self._active_s: dict[str, float] = {}
        """When each connection was active, the one that was last at the end."""

    @property
    def methods(self) -> Mapping[str, MethodStats]:
        """All methods that were called, and all of the contract, by `Method.key`."""
        return self.contract | self._others

    @property
    def served(self) -> int:
        """Calls of the contract that were answered."""
        return sum(each.served for each in self.contract.values())

    @property
    def refused(self) -> int:
        """Calls of the contract that were refused."""
        return sum(each.refused for each in self.contract.values())

    def client_count(self) -> int:
        """Returns how many connections were active within RECENT_S."""
        since_s = self._clock() - RECENT_S
        count = 0
        for active_s in reversed(self._active_s.values()):
            if active_s < since_s:
                break
            count += 1
        return count

    def on_call(self, call: CallContext) -> None:
        """Counts an open stream."""
        if call.method.streaming:
            self._of(call).open += 1

    def on_request(self, call: CallContext, request: Any) -> Any:
        """Notes the connection as active: the call has been admitted."""
        if call.method.of_contract:
            self._note_active(call.peer.connection)
        return request

    def on_response(self, call: CallContext, _response: Any) -> None:
        """Counts the first response, and notes the connection of a stream as active."""
        if not call.responded:
            call.responded = True
            self._of(call).served += 1
        if call.method.streaming and call.method.of_contract:
            self._note_active(call.peer.connection)

    def on_end(self, call: CallContext, error: BaseException | None) -> None:
        """Counts how the call ended, and how long it took."""
        stats = self._of(call)
        if call.method.streaming:
            stats.open -= 1
        if error is None:
            stats.ended[_OK] += 1
        else:
            stats.ended[status_code(error, call).name] += 1
            if isinstance(error, DomainError):
                stats.refused += 1
            elif isinstance(error, Exception) and not isinstance(error, grpc.aio.AbortError):
                stats.failed += 1
        stats.durations.add(time.perf_counter() - call.began_s)

    def _of(self, call: CallContext) -> MethodStats:
        known = self.contract if call.method.of_contract else self._others
        stats = known.get(call.method.key)
        if stats is None:
            stats = known[call.method.key] = MethodStats()
        return stats

    def _note_active(self, connection: str) -> None:
        active_s = self._active_s
        active_s.pop(connection, None)
        active_s[connection] = self._clock()
        if len(active_s) > _MAX_CONNECTIONS:
            del active_s[next(iter(active_s))]
