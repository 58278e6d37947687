"""SubscribeEvents over real connections: nothing is lost or doubled in silence, whatever breaks."""

import asyncio
import random
import time
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import grpc
import pytest

from console.client import (
    AsyncGatewayClient,
    CaughtUp,
    Event,
    EventGap,
    EventPosition,
    FaultSeverity,
    InvalidRequest,
    Outage,
)
from console.client.options import Backoff, ClientOptions
from console.client.results import ControlResult, EventKind, GapReason
from gateway.rpc.interceptors.presence import JOINED_AFTER_S
from omniseer.gateway.v1.event_pb2 import EVENT_GAP_REASON_NEW_RUN, EVENT_GAP_REASON_NO_LONGER_KEPT
from omniseer.gateway.v1.robot_gateway_pb2 import SubscribeEventsRequest
from tests.support.bad_links import Relay
from tests.support.event_server import EventServer
from tests.support.eventually import eventually
from tests.support.preview_double import PreviewDouble, serve_double
from tests.support.running_gateway import Operator, running_gateway

WITHIN_S = 30.0
QUICK = ClientOptions(stream_backoff=Backoff(first_s=0.01, longest_s=0.05))


@pytest.fixture
async def operator(tmp_path: Path) -> AsyncIterator[Operator]:
    server = await serve_double(tmp_path / "preview.sock", PreviewDouble())
    async with running_gateway(tmp_path / "preview.sock", faults={"startup_grace_ms": 0}) as operator:
        await eventually(operator.status, lambda it: it.preview.service_reachable, "they have met")
        yield operator
    await server.stop(None)


async def until(items: AsyncIterator[Any], kind: EventKind, beginning: str = "") -> Event:
    """The next event of this kind whose message begins so."""
    async with asyncio.timeout(WITHIN_S):
        async for item in items:
            if isinstance(item, Event) and item.kind is kind and item.message.startswith(beginning):
                return item
    raise AssertionError("the stream ended")


async def test_a_control_action_and_what_came_of_it(operator: Operator) -> None:
    async with AsyncGatewayClient(f"127.0.0.1:{operator.port}") as client:
        events = client.events()
        await client.enable_preview()
        action = await until(events, EventKind.CONTROL)
        assert action.control is not None
        assert (action.control.method, action.control.result) == ("SetPreviewMode", ControlResult.ACCEPTED)
        assert action.control.address.startswith("127.0.0.1:")
        assert "running" in action.control.answer
        assert (await until(events, EventKind.PREVIEW)).position.sequence > action.position.sequence


async def test_a_refused_control_action_is_an_event_as_well(operator: Operator) -> None:
    with pytest.raises(grpc.aio.AioRpcError):
        await operator.switch(True, 99)
    async with AsyncGatewayClient(f"127.0.0.1:{operator.port}") as client:
        action = await until(client.events(least=FaultSeverity.WARNING), EventKind.CONTROL)
    assert action.control is not None
    assert action.control.result is ControlResult.REFUSED
    assert "99" in action.control.answer


async def test_a_client_that_stays_and_leaves_is_two_events(operator: Operator) -> None:
    async with AsyncGatewayClient(f"127.0.0.1:{operator.port}") as here:
        events = here.events()
        own = await until(events, EventKind.CLIENT_JOINED)
        async with AsyncGatewayClient(f"127.0.0.1:{operator.port}") as other:
            began_s = time.monotonic()
            watching = other.watch_status()
            await anext(watching)
            joined = await until(events, EventKind.CLIENT_JOINED)
            assert time.monotonic() - began_s > JOINED_AFTER_S * 0.9
        left = await until(events, EventKind.CLIENT_LEFT)
        assert left.client_address == joined.client_address != own.client_address


async def test_a_place_that_was_not_reached_is_refused(operator: Operator) -> None:
    async with AsyncGatewayClient(f"127.0.0.1:{operator.port}") as client:
        run_id = (await client.status()).gateway.run_id
        assert run_id
        with pytest.raises(InvalidRequest, match="has not happened"):
            async for _ in client.events(EventPosition(run_id, 10_000)):
                pass


async def test_an_unknown_severity_is_refused_by_the_schema(operator: Operator) -> None:
    unknown = SubscribeEventsRequest(min_severity=9)  # type: ignore[arg-type]  # no value of the enum
    with pytest.raises(grpc.aio.AioRpcError) as seen:
        await operator.stub.SubscribeEvents(unknown).read()
    assert seen.value.code() is grpc.StatusCode.INVALID_ARGUMENT
    assert "min_severity" in (seen.value.details() or "")


async def test_the_overlays_short_list_comes_from_the_same_log(operator: Operator) -> None:
    async with AsyncGatewayClient(f"127.0.0.1:{operator.port}") as client:
        events = client.events()
        await client.enable_preview()
        # Before the two have met, the preview counts as faulted, which the list shows as a fault.
        running = await until(events, EventKind.PREVIEW, "preview running")
        messages = [event.message for event in (await client.overlay()).events]
    assert running.message in messages
    assert not any("SetPreviewMode" in message for message in messages)


@pytest.mark.parametrize(
    ("after", "reason", "missed"),
    [
        (EventPosition("run-1", 3), EVENT_GAP_REASON_NO_LONGER_KEPT, 12),
        (EventPosition("an earlier run", 99), EVENT_GAP_REASON_NEW_RUN, 15),
    ],
)
async def test_a_gap_is_sent_before_what_follows_it(after: EventPosition, reason: int, missed: int) -> None:
    async with EventServer(kept=5) as server:
        server.happen(20)
        async with grpc.aio.insecure_channel(f"127.0.0.1:{server.port}") as channel:
            request = SubscribeEventsRequest()
            request.after.run_id, request.after.sequence = after.run_id, after.sequence
            call = Operator(channel, server.port).stub.SubscribeEvents(request)
            gap = (await call.read()).gap
            assert (gap.reason, gap.missed_count) == (reason, missed)
            assert (gap.position.run_id, gap.position.sequence) == ("run-1", 15)
            assert [(await call.read()).event.sequence for _ in range(5)] == [16, 17, 18, 19, 20]
            assert (await call.read()).caught_up.sequence == 20
            call.cancel()


class Ledger:
    """Everything that one subscriber got, checked as it comes."""

    def __init__(self) -> None:
        self.position: EventPosition | None = None
        self.got: list[tuple[str, int]] = []
        self.missed: dict[str, int] = {}
        self.outages = 0

    def note(self, item: Event | EventGap | CaughtUp | Outage) -> None:
        match item:
            case Event():
                here, there = self.position, item.position
                if here is not None:
                    assert there == EventPosition(here.run_id, here.sequence + 1), "in order, no silent hole"
                self.got.append((there.run_id, there.sequence))
                self.position = there
            case EventGap():
                run_id = item.position.run_id
                assert self.position is not None
                assert item.reason is not GapReason.UNKNOWN, "the gateway announces its gaps"
                assert (item.reason is GapReason.NEW_RUN) is (run_id != self.position.run_id)
                self.missed[run_id] = self.missed.get(run_id, 0) + item.missed_count
                self.position = item.position
            case CaughtUp():
                self.position = item.position
            case Outage():
                self.outages += 1


@pytest.mark.parametrize("seed", range(4))
async def test_every_subscriber_gets_every_event_or_a_gap(seed: int) -> None:
    """Connections that break, a ring that is too small, a gateway that is started anew: all at random."""
    dice = random.Random(seed)
    ledgers = [Ledger() for _ in range(4)]
    async with EventServer(kept=20) as server, AsyncExitStack() as stack:
        relays = [stack.enter_context(Relay(server.port)) for _ in ledgers]
        followers = [
            asyncio.create_task(_follow(relay.port, ledger))
            for relay, ledger in zip(relays, ledgers, strict=True)
        ]

        async def unconnected() -> list[Ledger]:
            return [ledger for ledger in ledgers if ledger.position is None]

        # A client gives a robot up that it has never reached; from its first answer on it goes on for ever.
        await eventually(unconnected, lambda them: not them, "all have connected once", WITHIN_S)
        for _ in range(60):
            await asyncio.sleep(dice.uniform(0, 0.03))
            match dice.choice(("happen", "happen", "happen", "burst", "break", "break", "restart")):
                case "happen":
                    server.happen(dice.randint(1, 5))
                case "burst":
                    server.happen(30)
                case "break":
                    dice.choice(relays).cut()
                case "restart":
                    await server.restart()
        server.happen(1)

        async def behind() -> list[EventPosition | None]:
            assert not any(follower.done() for follower in followers), [each.result() for each in followers]
            return [ledger.position for ledger in ledgers if ledger.position != server.newest]

        await eventually(behind, lambda positions: not positions, "all are up to date", WITHIN_S)
        for follower in followers:
            follower.cancel()
        await asyncio.gather(*followers, return_exceptions=True)
    assert any(ledger.outages for ledger in ledgers), "something broke"
    for ledger in ledgers:
        assert len(set(ledger.got)) == len(ledger.got), "none twice"
        for run_id, count in server.happened.items():
            got = sum(1 for run, _ in ledger.got if run == run_id)
            if run_id == server.newest.run_id:
                assert got + ledger.missed.get(run_id, 0) == count, "all, or counted as missing"


async def _follow(port: int, ledger: Ledger) -> None:
    async with AsyncGatewayClient(f"127.0.0.1:{port}", QUICK) as client:
        async for item in client.events(EventPosition("none yet", 0)):
            if ledger.position is None and isinstance(item, EventGap):
                ledger.position = EventPosition("none yet", 0)
            ledger.note(item)
