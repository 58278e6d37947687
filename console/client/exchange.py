"""What is said between a client and a gateway, without the talking.

An exchange is a generator: it yields what is to be done next (send this, pause that long), is given what came
of it, and returns the result in the end. Deadlines, retries and the wait for a preview to settle are decided
here, once, for the blocking and the asyncio client; each of them only carries out the steps.
"""

import time
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeAlias, TypeVar

from console.client.clock import Clock, Offset
from console.client.errors import GatewayError, Unreachable
from console.client.mapping.methods import (
    GET_GATEWAY_INFO,
    GET_OVERLAY_SNAPSHOT,
    GET_SYSTEM_STATUS,
    PING,
    SET_PREVIEW_MODE,
    Method,
    PreviewWish,
)
from console.client.options import ClientOptions
from console.client.results import (
    GatewayInfo,
    OverlaySnapshot,
    PreviewChange,
    PreviewProfile,
    PreviewState,
    PreviewStatus,
    SystemStatus,
)

RequestT = TypeVar("RequestT")
ResultT = TypeVar("ResultT")

# An attempt gets at least this long, so that the last one is not sent just to fail.
_SHORTEST_ATTEMPT_S = 0.05


@dataclass(frozen=True, slots=True)
class Send(Generic[RequestT, ResultT]):
    """Step: call this method; give back its result, or the `GatewayError` it ended with."""

    method: Method[RequestT, ResultT]
    request: RequestT
    timeout_s: float


@dataclass(frozen=True, slots=True)
class Pause:
    """Step: let time pass; give back None."""

    seconds: float


@dataclass(frozen=True, slots=True)
class Done(Generic[ResultT]):
    """The exchange is over."""

    result: ResultT


Step: TypeAlias = Send[Any, Any] | Pause
Exchange: TypeAlias = Generator[Step, Any, ResultT]


def advance(exchange: Exchange[ResultT], outcome: Any) -> Step | Done[ResultT]:
    """Hands the outcome of the last step to an exchange (None to begin) and returns the next step.

    Raises:
        GatewayError: the exchange gave up.
    """
    try:
        return exchange.throw(outcome) if isinstance(outcome, GatewayError) else exchange.send(outcome)
    except StopIteration as end:
        return Done(end.value)


class Exchanges:
    """The exchanges of one client, and how often it had to ask again."""

    def __init__(self, options: ClientOptions, clock: Callable[[], float] = time.monotonic) -> None:
        self._options = options
        self._clock = clock
        self.retries = 0
        """Attempts beyond the first, of all calls together, since this client was made."""

    def status(self) -> Exchange[SystemStatus]:
        """One look at everything."""
        return self.ask(GET_SYSTEM_STATUS, None, self._options.answer_within_s)

    def overlay(self) -> Exchange[OverlaySnapshot]:
        """One look at what a screen draws over the picture."""
        return self.ask(GET_OVERLAY_SNAPSHOT, None, self._options.answer_within_s)

    def info(self) -> Exchange[GatewayInfo]:
        """One look at the gateway program."""
        return self.ask(GET_GATEWAY_INFO, None, self._options.answer_within_s)

    def ping(self, clock: Clock) -> Exchange[Offset]:
        """One look at the robot's clocks; `clock` learns from it."""
        sent_s = self._clock()
        time_there = yield from self.ask(PING, None, self._options.answer_within_s)
        received_s = self._clock()
        clock.note(sent_s, time_there, received_s)
        offset = clock.offset(received_s)
        assert offset is not None, "it has just learnt one"
        return offset

    def set_preview(self, wish: PreviewWish, settle_within_s: float) -> Exchange[PreviewChange]:
        """Tells the wish; then watches until it is fulfilled or known to have failed, or time is up."""
        change = yield from self.ask(SET_PREVIEW_MODE, wish, self._options.preview_within_s)
        until = self._clock() + settle_within_s
        while change.accepted and not _settled(change.preview, wish) and self._clock() < until:
            yield Pause(self._options.settle_poll_s)
            status = yield from self.status()
            change = replace(change, preview=status.preview)
        return change

    def ask(self, method: Method[RequestT, ResultT], request: RequestT, within_s: float) -> Exchange[ResultT]:
        """One call, with further attempts while the gateway can't be reached and time is left.

        Raises:
            GatewayError: as the last attempt ended.
        """
        started = self._clock()
        pauses = self._options.backoff.pauses()
        while True:
            left_s = within_s - (self._clock() - started)
            try:
                result: ResultT = yield Send(method, request, max(left_s, _SHORTEST_ATTEMPT_S))
            except Unreachable:
                pause_s = next(pauses)
                elapsed_s = self._clock() - started + pause_s
                if not method.idempotent or elapsed_s > min(self._options.backoff.give_up_after_s, within_s):
                    raise
            else:
                return result
            yield Pause(pause_s)
            self.retries += 1


def _settled(preview: PreviewStatus, wish: PreviewWish) -> bool:
    if not wish.enabled:
        return preview.state is PreviewState.DISABLED
    if preview.state is PreviewState.RUNNING:
        return wish.profile in (PreviewProfile.UNKNOWN, preview.profile)
    return preview.state is PreviewState.FAULTED
