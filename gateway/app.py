"""The gateway as a whole: builds the parts, starts them in order, stops them in reverse."""

import asyncio
import logging
import secrets
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from functools import partial
from typing import Final

from common.health import Health
from common.rpc import Observe, unobserved
from gateway.config import GatewaySettings, LimitSettings, MetricsSettings, SecuritySettings, SourceSettings
from gateway.door import Door
from gateway.knowledge import Knowledge
from gateway.metrics.calls import Calls
from gateway.metrics.collector import GatewayCollector, StreamFigures
from gateway.metrics.endpoint import serving_metrics
from gateway.metrics.loop_delay import LoopDelay
from gateway.platform.sampler import PlatformSampler
from gateway.preview_link.control import PreviewControl
from gateway.preview_link.link import PreviewLink
from gateway.preview_link.reconciler import Reconciler
from gateway.rpc.answers import Answers
from gateway.rpc.caller import Callers
from gateway.rpc.controls import Controls
from gateway.rpc.identity import caller_name
from gateway.rpc.limits import Limits
from gateway.rpc.server import SERVICE, serving
from gateway.rpc.servicer import RobotGateway, Streams
from gateway.rpc.staying import Staying
from gateway.rpc.subscribing import EventStreams
from gateway.rpc.tally import Tally
from gateway.rpc.watching import StatusWatch
from gateway.shown_settings import shown_settings
from gateway.status.board import Board
from gateway.status.preview import PreviewView

_log = logging.getLogger(__name__)

PREVIEW_HEALTH: Final = "preview"
"""The preview service's name in the health service. Without it the gateway as a whole serves all the same."""
OBSERVE_EVERY_S: Final = 0.2
"""How often the gateway looks for events by itself; news of the preview make it look at once."""
_PASSPHRASE_BYTES: Final = 24
"""Gives 32 characters, and more chance than AES-256 can use of its key."""


async def serve(settings: GatewaySettings, stop: asyncio.Event) -> None:
    """Serves until `stop` is set.

    Raises:
        UserError: a part can't start.
    """
    _tell_who_gets_in(settings.security)
    link = PreviewLink(settings.preview.socket, _reconciler(settings.preview_encrypted))
    tally = Tally()
    knowledge = Knowledge(settings, lambda: link.view, tally)
    door = Door(settings.security, knowledge.note, link.renew_passphrase)
    streams = Streams(
        StatusWatch(knowledge.snapshot, time.monotonic),
        EventStreams(knowledge.events),
        Staying(knowledge.note),
    )
    gateway = RobotGateway(
        knowledge.snapshot,
        Answers(knowledge.snapshot, lambda: link.view, time.monotonic),
        PreviewControl(link, settings.preview.settle_ms / 1000),
        Callers(settings.preview.advertised_host),
        streams,
        tally=tally,
        controls=Controls(knowledge.note, caller_name, door.note),
        configuration_json=shown_settings(settings),
    )
    board, health = knowledge.board, Health(SERVICE)
    with _ros_intake(settings.sources, board), PlatformSampler(settings.platform, board), door.recording():
        async with (
            _metrics(settings.metrics, knowledge, partial(_stream_figures, tally, streams)) as observe,
            serving(
                gateway,
                settings.grpc.host,
                settings.grpc.port,
                health,
                observe=observe,
                limits=_limits(settings.limits),
                guard=door.guard,
                credentials=door.credentials(),
                socket=settings.grpc.socket,
            ),
            asyncio.TaskGroup() as timers,
        ):
            background = [
                timers.create_task(link.run(), name="preview-link"),
                timers.create_task(streams.watch.run(), name="status-watch"),
                timers.create_task(_observe(knowledge, link, streams.staying, door), name="observer"),
                timers.create_task(door.run(), name="door"),
                timers.create_task(_tell_health(link, health), name="health"),
            ]
            await stop.wait()
            for task in background:
                task.cancel()
    _log.info("stopped")


def _limits(settings: LimitSettings) -> Limits:
    return Limits(
        connections=settings.connections,
        connections_per_address=settings.connections_per_address,
        streams_per_connection=settings.streams_per_connection,
        requests_per_s=settings.requests_per_s,
        burst=settings.burst,
        request_bytes=settings.request_bytes,
    )


def _tell_who_gets_in(security: SecuritySettings) -> None:
    if security.insecure and security.credentials is None:
        _log.warning("security.insecure: everybody who reaches this gateway may read and switch everything")
    elif security.insecure and not security.guarded:
        _log.warning("security.insecure: everybody on the way may read tokens and answers")


def _reconciler(encrypted: bool) -> Reconciler:
    # Milliseconds since this machine's start: a later gateway's revisions are larger than an earlier one's.
    first_revision = time.clock_gettime_ns(time.CLOCK_BOOTTIME) // 1_000_000
    return Reconciler(first_revision, _new_passphrase if encrypted else None)


def _new_passphrase() -> str:
    return secrets.token_urlsafe(_PASSPHRASE_BYTES)


@contextmanager
def _ros_intake(sources: tuple[SourceSettings, ...], board: Board) -> Iterator[None]:
    """Reads ROS while the block lasts. A gateway without sources needs no ROS at all."""
    if not sources:
        _log.info("no sources are configured; ROS is not used")
        yield
        return
    # Late, because whoever needs no ROS need not have it installed.
    from gateway.ros.intake import intake  # noqa: PLC0415

    with intake(sources, board):
        yield


@asynccontextmanager
async def _metrics(
    settings: MetricsSettings, knowledge: Knowledge, streams: Callable[[], StreamFigures]
) -> AsyncIterator[Observe]:
    """Serves them while the block lasts, where they are wanted. Yields what has to be told of every call."""
    if settings.port is None:
        yield unobserved
        return
    calls, loop_delay = Calls(), LoopDelay()
    collector = GatewayCollector(knowledge.snapshot, calls, loop_delay, streams)
    async with serving_metrics(collector.text, settings.host, settings.port):
        measuring = asyncio.create_task(loop_delay.run(), name="loop-delay")
        try:
            yield calls
        finally:
            measuring.cancel()


def _stream_figures(tally: Tally, streams: Streams) -> StreamFigures:
    going_on = {method: counts.open for method, counts in tally.methods.items() if counts.open}
    return StreamFigures(going_on, streams.watch.skipped, streams.events.gaps)


async def _observe(knowledge: Knowledge, link: PreviewLink, staying: Staying, door: Door) -> None:
    """Notes what changes, whether or not anybody asks: the preview at once, the rest at the next look."""
    while True:
        knowledge.access = door.view()
        now = knowledge.snapshot()
        knowledge.observe(now)
        staying.look()
        await link.changes.wait_until(partial(_differs, link, now.preview), OBSERVE_EVERY_S)


async def _tell_health(link: PreviewLink, health: Health) -> None:
    """Keeps the health service's word on the preview true."""
    while True:
        seen = link.view
        health.set_serving(PREVIEW_HEALTH, serving=seen.service_reachable)
        await link.changes.wait_until(partial(_differs, link, seen), OBSERVE_EVERY_S)


def _differs(link: PreviewLink, seen: PreviewView) -> bool:
    return link.view is not seen
