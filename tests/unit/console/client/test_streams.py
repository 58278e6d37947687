"""Streams over any number of connections, without a network: which steps they take, in which order."""

from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from typing import Any

import pytest

from console.client.errors import (
    DeadlineExceeded,
    GatewayError,
    InvalidRequest,
    Overloaded,
    Unreachable,
    Unsupported,
)
from console.client.event_feed import EventFeed
from console.client.mapping.methods import (
    GET_SYSTEM_STATUS,
    SUBSCRIBE_EVENTS,
    WATCH_SYSTEM_STATUS,
    Method,
    events_request,
    watch_request,
)
from console.client.options import Backoff, ClientOptions
from console.client.results import CaughtUp, EventPosition, FaultSeverity, WatchedStatus
from console.client.streams import Outage, Streams

OPTIONS = ClientOptions(
    backoff=Backoff(first_s=0.1, longest_s=0.4, give_up_after_s=1.0),
    stream_backoff=Backoff(first_s=0.1, longest_s=0.4),
)
STATUS: Any = WatchedStatus(status=None, monotonic_ns=1)  # type: ignore[arg-type]  # never looked into
GONE = Unreachable("gone")


@dataclass(frozen=True)
class Open:
    method: Method[Any]
    request: Any
    newest_only: bool


@dataclass(frozen=True)
class Read:
    within_s: float


@dataclass(frozen=True)
class Call:
    method: Method[Any]


@dataclass(frozen=True)
class Sleep:
    seconds: float


@dataclass(frozen=True)
class Yielded:
    item: Any


class OutOfOutcomes(Exception):  # noqa: N818 - no error: the script ends here
    """A test's script ends."""


@dataclass
class ScriptedTransport:
    """Answers reads and calls with the outcomes of a test, keeps the steps, and lets sleep move the clock."""

    outcomes: list[Any]
    now_s: float = 0.0
    steps: list[Any] = field(default_factory=list)
    open_calls: int = 0

    def open(self, method: Method[Any], request: Any, *, newest_only: bool) -> "ScriptedTransport":
        assert self.open_calls == 0, "the call before has ended"
        self.open_calls += 1
        self.steps.append(Open(method, request, newest_only))
        return self

    def cancel(self) -> None:
        self.open_calls -= 1

    async def read(self, within_s: float) -> Any:
        self.steps.append(Read(within_s))
        return self._outcome()

    async def call(self, method: Method[Any], _request: Any, _timeout_s: float) -> Any:
        self.steps.append(Call(method))
        return self._outcome()

    async def sleep(self, seconds: float) -> None:
        self.steps.append(Sleep(seconds))
        self.now_s += seconds

    def _outcome(self) -> Any:
        if not self.outcomes:
            raise OutOfOutcomes
        outcome = self.outcomes.pop(0)
        if isinstance(outcome, GatewayError):
            raise outcome
        return outcome


class Driver:
    """Reads a stream of a scripted transport until a read finds no outcome left."""

    def __init__(self, *outcomes: Any) -> None:
        self.transport = ScriptedTransport(list(outcomes))
        self.streams = Streams(self.transport, OPTIONS, lambda: self.transport.now_s)

    async def run(self, stream: AsyncIterator[Any]) -> list[Any]:
        try:
            async for item in stream:
                self.transport.steps.append(Yielded(item))
        except OutOfOutcomes:
            pass
        assert self.transport.open_calls == 0, "the stream ended its call"
        return self.transport.steps


def kinds(steps: list[Any]) -> list[str]:
    return [type(step).__name__ for step in steps]


async def test_what_is_read_is_yielded() -> None:
    driver = Driver(STATUS, STATUS)
    steps = await driver.run(driver.streams.status(0.5))
    assert kinds(steps) == ["Open", "Read", "Yielded", "Read", "Yielded", "Read"]
    request = watch_request(0.5, include_detections=False)
    assert steps[0] == Open(WATCH_SYSTEM_STATUS, request, newest_only=True)
    assert steps[2] == Yielded(STATUS)


async def test_silence_is_an_outage_later_than_the_gateways_keepalive() -> None:
    driver = Driver(STATUS)
    steps = await driver.run(driver.streams.status(3.0))
    assert steps[1].within_s == OPTIONS.answer_within_s, "the first comes at once"
    assert steps[-1].within_s == 3.0 + OPTIONS.answer_within_s


async def test_an_outage_is_reported_and_retried_with_growing_pauses() -> None:
    driver = Driver(STATUS, *[GONE] * 5, STATUS, GONE)
    steps = await driver.run(driver.streams.status(0.1))
    outages = [step.item.attempt for step in steps if isinstance(step, Yielded) and step.item is not STATUS]
    assert outages == [1, 2, 3, 4, 5, 1]
    pauses = [step.seconds for step in steps if isinstance(step, Sleep)]
    assert pauses == pytest.approx([0.1, 0.2, 0.4, 0.4, 0.4, 0.1])
    assert driver.streams.reconnects == 6


async def test_a_robot_that_never_answered_is_given_up() -> None:
    driver = Driver(*[GONE] * 20)
    with pytest.raises(Unreachable):
        await driver.run(driver.streams.status(0.1))
    assert driver.transport.now_s <= 1.0


@pytest.mark.parametrize("error", [DeadlineExceeded("silent"), Overloaded("too much")])
async def test_silence_and_a_full_gateway_are_outages(error: GatewayError) -> None:
    driver = Driver(STATUS, error)
    assert Yielded(Outage(error, 1)) in await driver.run(driver.streams.status(0.1))


async def test_an_error_that_no_retry_mends_ends_the_stream() -> None:
    driver = Driver(InvalidRequest("no such place"))
    with pytest.raises(InvalidRequest):
        await driver.run(driver.streams.events(EventFeed()))


async def test_events_resume_where_they_stopped() -> None:
    driver = Driver(CaughtUp(position=EventPosition("run", 7)), GONE)
    steps = await driver.run(driver.streams.events(EventFeed()))
    opened = [step for step in steps if isinstance(step, Open)]
    assert [each.method for each in opened] == [SUBSCRIBE_EVENTS] * 2
    assert [each.request for each in opened] == [
        events_request(after, FaultSeverity.UNKNOWN) for after in (None, EventPosition("run", 7))
    ]
    assert not opened[0].newest_only


async def test_a_gateway_without_the_stream_is_polled() -> None:
    driver = Driver(Unsupported("older"), None, GONE, None)
    asked = (await driver.run(driver.streams.status(0.5)))[2:]
    per_poll = ["Call", "Yielded", "Sleep"]
    assert kinds(asked) == [*per_poll, *per_poll, *per_poll, "Call"]
    assert asked[0].method is GET_SYSTEM_STATUS
    assert asked[2] == Sleep(0.5)
    assert asked[4] == Yielded(Outage(GONE, 1))


async def test_an_interval_longer_than_any_gateway_streams_is_polled() -> None:
    driver = Driver()
    assert isinstance((await driver.run(driver.streams.status(61.0)))[0], Call)


async def test_closing_the_stream_ends_its_call() -> None:
    driver = Driver(STATUS, STATUS)
    stream = driver.streams.status(0.5)
    assert await anext(stream) is STATUS
    assert driver.transport.open_calls == 1
    await stream.aclose()
    assert driver.transport.open_calls == 0
