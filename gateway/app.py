"""The gateway program: starts the parts in order, and stops them in reverse."""

import asyncio
import logging
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from functools import partial
from typing import Final

import grpc

from common import heartbeat
from common.advertisement import Advertisement
from common.findings import Verdict
from common.metrics_endpoint import serving_metrics
from gateway.assembly import Gateway, ThisRobot, build
from gateway.config import GatewaySettings, SecuritySettings
from gateway.links.preview.control import PreviewLink
from gateway.links.preview.exposure import video_exposure
from gateway.platform.advertising import advertise
from gateway.rpc.server import SERVICE, serving
from gateway.status.board import Board
from gateway.status.preview import Listener
from gateway.status.snapshot import Snapshot

_log = logging.getLogger(__name__)

PREVIEW_HEALTH: Final = "preview"
"""The preview service's name in the health service. The gateway serves without it."""
DRIVE_HEALTH: Final = "drive"
"""The drive program's name there, where the robot is set up for driving."""
RECORDER_HEALTH: Final = "recorder"
"""The recorder's name there, where the robot is set up for recording."""
BRIDGE_HEALTH: Final = "bridge"
"""The bridge's name there, where the robot is set up for a fleet."""
OBSERVE_EVERY_S: Final = 0.2
"""How often faults and events are looked for; a change of the preview causes a look at once."""
ROS_HUNG_AFTER_S: Final = 30.0
"""Without a pass of the ROS sampler: no load explains it, and only another process reads ROS again."""


async def serve(settings: GatewaySettings, stop: asyncio.Event) -> None:
    """Runs the gateway of this robot until `stop` is set.

    Raises:
        UserError: a part can't start.
    """
    _warn_of_exposure(settings.security)
    async with running(build(settings, ThisRobot(settings))):
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
    """Updates faults, events and the health service, whether or not an operator is connected."""
    link, health = gateway.preview_link, gateway.health
    listener: Listener | None = None
    while True:
        access = gateway.access.view()
        seen = gateway.state.observe(access)
        health.set_serving(SERVICE, serving=not (seen.ros_stalled or access.closed))
        health.set_serving(PREVIEW_HEALTH, serving=seen.preview.service_reachable)
        if seen.teleop:
            health.set_serving(DRIVE_HEALTH, serving=seen.teleop.drive.reachable)
        if gateway.recording and seen.recorder:
            health.set_serving(RECORDER_HEALTH, serving=seen.recorder.reachable)
            gateway.recording.incidents.take(seen.faults)
        if gateway.cloud and seen.cloud:
            health.set_serving(BRIDGE_HEALTH, serving=seen.cloud.reachable)
            if gateway.cloud.copies:
                gateway.cloud.copies.take(seen.cloud, seen.recorder)
        heartbeat.own().withheld = hung_part(gateway.state.board, time.monotonic())
        gateway.interceptors.presence.report_joined()
        gateway.interceptors.audit.record_due()
        if seen.preview.listener and seen.preview.listener != listener:
            listener = seen.preview.listener
            _log_exposure(gateway.settings, listener)
        await link.changes.wait_until(partial(_has_changed, link, seen), OBSERVE_EVERY_S)


def hung_part(board: Board, now_s: float) -> str:
    """Returns which part of this process hangs so that only a restart mends it, for the log; else ""."""
    passed_s = board.ros_passed_s
    if passed_s is None or now_s - passed_s <= ROS_HUNG_AFTER_S:
        return ""
    return f"ROS has not been read for {now_s - passed_s:.0f} s"


def _has_changed(link: PreviewLink, seen: Snapshot) -> bool:
    return link.view is not seen.preview


def _log_exposure(settings: GatewaySettings, listener: Listener) -> None:
    found = video_exposure(settings, listener)
    if found.verdict is Verdict.GOOD:
        _log.info("%s", found.what)
    else:
        _log.warning("%s (%s). %s", found.what, found.why, found.remedy)


def _warn_of_exposure(security: SecuritySettings) -> None:
    if security.insecure and security.credentials is None:
        _log.warning("security.insecure: anyone who reaches this gateway may read and control everything")
    elif security.insecure and not security.guarded:
        _log.warning("security.insecure: anyone on the network path may read tokens and responses")
