"""The failure table of gateway.links for any service: one in memory, and the preview's over real gRPC."""

import asyncio
import re
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from gateway.links.link import ServiceLink
from gateway.links.preview.model import PreviewModel
from gateway.links.preview.state import PreviewSpec
from gateway.links.preview.wire import PROFILES, PreviewConnector
from gateway.links.reconciler import Reconciler
from gateway.status.preview import Profile
from tests.support.lamp import LampConnector, LampModel, LampService, LampSpec, LampView
from tests.support.preview_double import Behaviour, PreviewDouble, serve_double

if TYPE_CHECKING:
    import grpc

SILENCE_S = 4.0
APPLY_DEADLINE_S = 1.5
"""Both longer than a busy machine may hold up a double that is well."""
WATCHED_S = 2.0
"""Several signs of life, of either double."""
WITHIN_S = 15.0


class Ground(ABC):
    """A kind of service.

    Attributes:
        some, other: two desired states.
        refused: one that the service refuses, once `refuse` was called.
        refusal: the words of it.
    """

    some: Any
    other: Any
    refused: Any
    refusal: str

    @abstractmethod
    def new_link(self) -> ServiceLink[Any, Any, Any]:
        """A link as after a start of the gateway."""

    @abstractmethod
    async def start(self) -> Any:
        """Starts a process with an empty memory: an object with `applied`, `thawed` and `reports_end`."""

    @abstractmethod
    async def stop(self) -> None:
        """Ends it."""

    @abstractmethod
    def sent(self) -> list[Any]:
        """The specs that the present process was sent."""

    @abstractmethod
    def refuse(self) -> None:
        """Has `refused` refused."""

    @abstractmethod
    def applied_by_another_gateway(self) -> None:
        """Makes the applied revision a newer one."""


class InMemory(Ground):
    some, other, refused, refusal = LampSpec(10), LampSpec(90), LampSpec(1000), "too bright"

    def __init__(self) -> None:
        self.connector = LampConnector()
        self._processes = 0

    def new_link(self) -> ServiceLink[Any, Any, Any]:
        return ServiceLink(
            "lamp",
            self.connector,
            Reconciler(1000, LampModel()),
            silence_s=SILENCE_S,
            apply_deadline_s=APPLY_DEADLINE_S,
        )

    async def start(self) -> LampService:
        self._processes += 1
        self.connector.process = LampService(f"process-{self._processes}")
        return self.connector.process

    async def stop(self) -> None:
        if self.connector.process:
            self.connector.process.gone = True
        self.connector.process = None

    def sent(self) -> list[Any]:
        assert self.connector.process
        return [desired.spec for desired in self.connector.process.applied]

    def refuse(self) -> None:
        pass  # The brightness alone decides.

    def applied_by_another_gateway(self) -> None:
        assert self.connector.process
        report = self.connector.process.report
        self.connector.process.report = replace(report, applied_revision=report.applied_revision + 5)


class PreviewOverGrpc(Ground):
    some, other = PreviewSpec(True, Profile.LOW_BW), PreviewSpec(True, Profile.HIGH_QUALITY)
    refused, refusal = PreviewSpec(True, Profile.BALANCED), "the double refuses"

    def __init__(self, socket: Path) -> None:
        self._socket = socket
        self._double: PreviewDouble | None = None
        self._server: grpc.aio.Server | None = None

    def new_link(self) -> ServiceLink[Any, Any, Any]:
        return ServiceLink(
            "preview",
            PreviewConnector(self._socket),
            Reconciler(1000, PreviewModel(lambda _address: False, str)),
            silence_s=SILENCE_S,
            apply_deadline_s=APPLY_DEADLINE_S,
        )

    async def start(self) -> PreviewDouble:
        self._double = PreviewDouble()
        self._server = await serve_double(self._socket, self._double)
        return self._double

    async def stop(self) -> None:
        if self._server:
            await self._server.stop(None)

    def sent(self) -> list[Any]:
        assert self._double
        profiles = {number: profile for profile, number in PROFILES.items()}
        return [PreviewSpec(each.enabled, profiles[each.profile]) for each in self._double.applied]

    def refuse(self) -> None:
        assert self._double
        self._double.behaviour = Behaviour.REFUSES

    def applied_by_another_gateway(self) -> None:
        assert self._double
        self._double.actual.applied_revision += 5


@pytest.fixture(params=["memory", "grpc"])
async def ground(request: pytest.FixtureRequest, tmp_path: Path) -> AsyncIterator[Ground]:
    ground = InMemory() if request.param == "memory" else PreviewOverGrpc(tmp_path / "preview.sock")
    yield ground
    await ground.stop()


@asynccontextmanager
async def running(link: ServiceLink[Any, Any, Any]) -> AsyncIterator[ServiceLink[Any, Any, Any]]:
    task = asyncio.create_task(link.run())
    try:
        yield link
    finally:
        task.cancel()
        (ended,) = await asyncio.gather(task, return_exceptions=True)
        assert isinstance(ended, asyncio.CancelledError)


@pytest.fixture
async def link(ground: Ground) -> AsyncIterator[ServiceLink[Any, Any, Any]]:
    async with running(ground.new_link()) as link:
        yield link


def reachable(link: ServiceLink[Any, Any, Any]) -> bool:
    view = link.view
    return bool(view.reachable if isinstance(view, LampView) else view.service_reachable)


async def until(link: ServiceLink[Any, Any, Any], condition: Callable[[], object]) -> None:
    assert await link.changes.wait_until(lambda: bool(condition()), WITHIN_S), link.view


async def connected(link: ServiceLink[Any, Any, Any]) -> None:
    await until(link, lambda: reachable(link))


async def test_a_service_that_comes_late_gets_the_desired_state(ground: Ground, link: Any) -> None:
    desired = link.request(ground.some)
    await until(link, lambda: link.failures >= 2)
    assert not reachable(link)
    assert re.search("no process runs|nothing answers", repr(link.view))
    service = await ground.start()
    await until(link, lambda: reachable(link) and service.applied)
    assert await link.wait_until_settled(desired, WITHIN_S)
    assert link.failures == 0
    assert ground.sent() == [ground.some]


async def test_a_new_process_gets_the_desired_state_again(ground: Ground, link: Any) -> None:
    first = await ground.start()
    await connected(link)
    assert await link.wait_until_settled(link.request(ground.some), WITHIN_S)
    await ground.stop()
    await until(link, lambda: not reachable(link))
    second = await ground.start()
    await until(link, lambda: second.applied)
    assert ground.sent() == [ground.some]
    assert second.applied[0].revision == first.applied[0].revision


async def test_a_frozen_service_is_noticed_and_the_same_process_is_sent_nothing_again(
    ground: Ground, link: Any
) -> None:
    service = await ground.start()
    await connected(link)
    assert await link.wait_until_settled(link.request(ground.some), WITHIN_S)
    service.thawed.clear()
    await until(link, lambda: not reachable(link))
    assert f"no report for {SILENCE_S:g} s" in repr(link.view)
    service.thawed.set()
    await connected(link)
    assert len(service.applied) == 1


async def test_a_request_that_is_not_answered_is_a_lost_service(ground: Ground, link: Any) -> None:
    service = await ground.start()
    await connected(link)
    service.thawed.clear()
    desired = link.request(ground.some)
    assert await link.wait_until_settled(desired, WITHIN_S)
    assert f"no answer to a request for {APPLY_DEADLINE_S:g} s" in repr(link.view)
    service.thawed.set()
    await until(link, lambda: service.applied and reachable(link))
    assert await link.wait_until_settled(desired, WITHIN_S)


async def test_a_refused_request_is_not_repeated(ground: Ground, link: Any) -> None:
    service = await ground.start()
    ground.refuse()
    await connected(link)
    assert await link.wait_until_settled(link.request(ground.refused), WITHIN_S)
    view = link.view
    assert ground.refusal in repr(view)
    assert reachable(link)
    later = asyncio.get_running_loop().time() + WATCHED_S
    await link.changes.wait_until(lambda: asyncio.get_running_loop().time() > later, 2 * WATCHED_S)
    assert len(service.applied) == 1, "though it has reported since then"
    assert link.view is view, "a report without a change makes no new view"


async def test_a_stream_of_reports_that_ends_is_a_lost_service(ground: Ground, link: Any) -> None:
    service = await ground.start()
    await connected(link)
    assert await link.wait_until_settled(link.request(ground.some), WITHIN_S)
    service.reports_end = True
    await until(link, lambda: not reachable(link))
    assert "closed its stream" in repr(link.view)
    await connected(link)


async def test_a_revision_of_another_gateway_is_overruled(ground: Ground, link: Any) -> None:
    service = await ground.start()
    await connected(link)
    desired = link.request(ground.some)
    assert await link.wait_until_settled(desired, WITHIN_S)
    ground.applied_by_another_gateway()
    await until(link, lambda: len(service.applied) == 2)
    assert ground.sent() == [ground.some, ground.some]
    assert link.desired.revision == desired.revision + 6


async def test_a_restarted_gateway_adopts_and_applies_nothing(ground: Ground) -> None:
    service = await ground.start()
    async with running(ground.new_link()) as link:
        await connected(link)
        assert await link.wait_until_settled(link.request(ground.some), WITHIN_S)
    async with running(ground.new_link()) as link:
        await connected(link)
        assert link.desired.spec == ground.some
    assert len(service.applied) == 1


async def test_the_newest_of_many_requests_counts(ground: Ground, link: Any) -> None:
    service = await ground.start()
    await connected(link)
    requests = [link.request(spec) for spec in (ground.some, ground.other) * 50]
    assert all(await asyncio.gather(*(link.wait_until_settled(each, WITHIN_S) for each in requests)))
    assert ground.sent()[-1] == ground.other
    assert service.applied[-1].revision == requests[-1].revision


async def test_a_request_cuts_a_pause_short(ground: Ground, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("FIRST_PAUSE_S", "LONGEST_PAUSE_S"):
        monkeypatch.setattr(f"gateway.links.watch.{name}", 10 * WITHIN_S)
    async with running(ground.new_link()) as link:
        await until(link, lambda: link.failures == 1)
        assert await link.wait_until_settled(link.request(ground.some), WITHIN_S)
        assert link.failures == 2


async def test_connections_close_with_the_link() -> None:
    ground = InMemory()
    await ground.start()
    async with running(ground.new_link()) as link:
        await connected(link)
        assert ground.connector.open == 1
    assert ground.connector.open == 0
