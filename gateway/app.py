"""The gateway program: starts the parts in order, and stops them in reverse."""

import asyncio
import logging
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from functools import partial
from typing import Final

import grpc

from common import heartbeat
from common.advertisement import Advertisement
from common.garbage import freeze_objects
from common.metrics_endpoint import serving_metrics
from gateway.assembly import Gateway, ThisRobot, build
from gateway.config import GatewaySettings, SecuritySettings, without_effect
from gateway.links.preview.control import PreviewLink
from gateway.platform.advertising import advertise
from gateway.rpc.server import SERVICE, serving
from gateway.status.snapshot import Snapshot

_log = logging.getLogger(__name__)

OBSERVE_EVERY_S: Final = 0.2
"""How often faults and events are looked for; a change of the preview causes a look at once."""


async def serve(settings: GatewaySettings, stop: asyncio.Event) -> None:
    """Runs the gateway of this robot until `stop` is set.

    Raises:
        UserError: a part can't start.
    """
    _warn_of_exposure(settings.security)
    for sentence in without_effect(settings):
        _log.warning("%s", sentence)
    async with running(build(settings, ThisRobot(settings))):
        freeze_objects()
        heartbeat.own().ready()
        await stop.wait()
    _log.info("stopped")


@asynccontextmanager
async def running(gateway: Gateway, extra: Sequence[grpc.GenericRpcHandler] = ()) -> AsyncIterator[int]:
    """Runs a gateway while the block lasts.

    Args:
        gateway: as `build` returned it.
        extra: further services for the operator's server.

    Yields:
        The operators' TCP port.

    Raises:
        UserError: a part can't start.
    """
    with gateway.outside.feeding(gateway.state.board), gateway.access.recording():
        async with (
            _metrics(gateway),
            serving(
                gateway.settings.grpc,
                gateway.services,
                gateway.interceptors,
                gateway.health,
                max_connections=gateway.max_connections,
                credentials=gateway.access.server_credentials,
                extra=extra,
            ) as port,
            asyncio.TaskGroup() as tasks,
        ):
            background = [
                tasks.create_task(gateway.preview_link.run(), name="preview-link"),
                tasks.create_task(gateway.status_stream.run(), name="status-stream"),
                tasks.create_task(gateway.access.run(), name="access"),
                tasks.create_task(_observe(gateway), name="observer"),
                tasks.create_task(gateway.connection_guard.run(port), name="connection-guard"),
            ]
            if gateway.settings.discovery.advertise:
                background.append(tasks.create_task(_advertise(gateway.settings, port), name="advertising"))
            if teleop := gateway.teleop:
                background += [
                    tasks.create_task(teleop.link.run(), name="drive-link"),
                    tasks.create_task(teleop.follow(), name="drive-reports"),
                    tasks.create_task(teleop.run(), name="teleop"),
                ]
            if recording := gateway.recording:
                background += [
                    tasks.create_task(recording.link.run(), name="recorder-link"),
                    tasks.create_task(recording.incidents.run(), name="incidents"),
                ]
            if cloud := gateway.cloud:
                background += [
                    tasks.create_task(cloud.link.run(), name="bridge-link"),
                    tasks.create_task(cloud.hub_requests.run(), name="hub-requests"),
                ]
                if cloud.copies:
                    background.append(tasks.create_task(cloud.copies.run(), name="copies"))
            try:
                yield port
            finally:
                for task in background:
                    task.cancel()


@asynccontextmanager
async def _metrics(gateway: Gateway) -> AsyncIterator[None]:
    """Serves Prometheus while the block lasts, where the settings name a port."""
    settings = gateway.settings.metrics
    if settings.port is None:
        yield
        return
    async with serving_metrics(gateway.metrics.text, settings.host, settings.port):
        measuring = asyncio.create_task(gateway.loop_delay.run(), name="loop-delay")
        try:
            yield
        finally:
            measuring.cancel()


async def _advertise(settings: GatewaySettings, port: int) -> None:
    contract = SERVICE.rpartition(".")[0]
    announced = Advertisement(settings.name, contract, settings.security.guarded)
    await advertise(announced, port, settings.grpc.host, settings.discovery.addresses)


async def _observe(gateway: Gateway) -> None:
    """Updates faults and events, whether or not an operator is connected, and hands on what was seen."""
    link, interceptors = gateway.preview_link, gateway.interceptors
    while True:
        seen = gateway.state.observe()
        for subscriber in gateway.subscribers:
            subscriber.take(seen)
        interceptors.presence.report_joined()
        interceptors.audit.record_due()
        await link.changes.wait_until(partial(_has_changed, link, seen), OBSERVE_EVERY_S)


def _has_changed(link: PreviewLink, seen: Snapshot) -> bool:
    return link.view is not seen.preview


def _warn_of_exposure(security: SecuritySettings) -> None:
    if security.insecure and security.credentials is None:
        _log.warning("security.insecure: anyone who reaches this gateway may read and control everything")
    elif security.insecure and not security.guarded:
        _log.warning("security.insecure: anyone on the network path may read tokens and responses")
