"""Assembles the bridge, starts its parts in order and stops them in reverse."""

import asyncio
import logging
import secrets
from contextlib import aclosing
from datetime import UTC, datetime
from functools import partial
from typing import TYPE_CHECKING, Any

from bridge.commands.consumer import CommandConsumer
from bridge.commands.pending_requests import PendingRequests
from bridge.config import BridgeSettings
from bridge.connection.connection_status import Status
from bridge.connection.robot_state import is_charging
from bridge.connection.sender import Sender
from bridge.connection.state_sender import StateSender
from bridge.connection.uploading import NoUploads, QueuedUploads, Uploading, apply_rule
from bridge.outbox.outbox import Outbox, outbox
from bridge.outbox.uploads import StoredUploads, most_kept
from bridge.robot.calls import GatewayCalls
from bridge.robot.events import EventReader
from bridge.robot.status import StatusReader
from bridge.rpc.servicer import SERVICE, BridgeServicer
from bridge.uploads import hours
from bridge.uploads.kept_queue import KeptQueue
from bridge.uploads.uploads import Fleet, Uploads
from common import bind, heartbeat, rpc
from common.broadcast import Broadcast
from common.health import Health
from common.tasks import first_to_end
from fleet.connection import FleetAddress, Hub, connect
from fleet.names import inbox_prefix
from fleet.receipt_keys import read_public_keys
from omniseer.bridge.v1 import bridge_service_pb2 as pb

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine

_log = logging.getLogger(__name__)

_RUN_ID_BYTES = 8


async def serve(settings: BridgeSettings, stop: asyncio.Event) -> None:
    """Connects the robot with its fleet, and serves the gateway, until `stop`.

    Raises:
        UserError: the socket can't be used, or a file of the robot's enrolment can't be read.
    """
    if hours.are_doubtful(settings.uploads, datetime.now(UTC)):
        _log.warning("uploads.hours: %s. %s", hours.DOUBT, hours.REMEDY)
    robot, run_id = settings.hub.robot, secrets.token_hex(_RUN_ID_BYTES)
    async with (
        outbox(settings.root, settings.outbox.max_bytes) as kept,
        connect(_address(settings)) as hub,
        aclosing(GatewayCalls(settings.gateway, run_id)) as gateway,
    ):
        robot_status = StatusReader(settings.gateway)
        changes = Broadcast()
        queue = _queue(settings, kept, hub, gateway, status=robot_status, changes=changes)
        uploads: Uploading = QueuedUploads(queue) if queue else NoUploads()
        sender = Sender(robot, kept, hub)
        status = Status(
            robot,
            settings.hub.fleet,
            outbox=kept,
            hub=hub,
            sender=sender,
            uploads=uploads,
            changes=changes,
            gateway=lambda: robot_status.error,
        )
        requests = PendingRequests(robot, kept, changes.notify_all)
        states = StateSender(
            robot,
            settings.advertised_target,
            run_id,
            status=robot_status,
            outbox=kept,
            uploads=uploads,
            hub=hub,
        )
        events = EventReader(settings.gateway, kept)

        def retries() -> pb.Retries:
            return pb.Retries(
                hub=sender.failures,
                state=states.failures,
                disk=kept.refusals,
                gateway=events.failures,
                upload=queue.cuts if queue else 0,
            )

        parts: list[Callable[[], Coroutine[Any, Any, None]]] = [
            events.run,
            robot_status.run,
            sender.run,
            states.run,
            hub.lasting,
        ]
        if queue:
            parts += [partial(queue.run, stop), partial(apply_rule, queue, gateway)]
        if settings.commands.allowed:
            parts.append(CommandConsumer(settings, hub, requests).run)
        server = rpc.new_server()
        servicer = BridgeServicer(run_id, status, uploads, requests, not_taken=hub.not_taken, retries=retries)
        servicer.register(server)
        Health(SERVICE).register(server)
        bind.bind_unix(server, settings.socket)
        await server.start()
        heartbeat.own().ready()
        _log.info("serving on %s; robot %s of fleet %s", settings.socket, robot, settings.hub.fleet)
        try:
            # A defect in one of them ends the program, which is then restarted.
            await first_to_end(stop.wait(), *(part() for part in parts))
        finally:
            await server.stop(rpc.STOP_GRACE_S)
            settings.socket.unlink(missing_ok=True)


def _queue(
    settings: BridgeSettings,
    kept: Outbox,
    hub: Hub,
    gateway: GatewayCalls,
    *,
    status: StatusReader,
    changes: Broadcast,
) -> Uploads | None:
    """Returns the uploads; None for a robot that has no receivers' keys."""
    if settings.hub.receipts is None:
        return None
    fleet = Fleet(
        fleet=settings.hub.fleet, robot=settings.hub.robot, keys=read_public_keys(settings.hub.receipts)
    )
    return Uploads(
        settings.uploads,
        fleet,
        queue=KeptQueue(StoredUploads(kept), changes.notify_all, most_kept=most_kept(kept.max_bytes)),
        source=gateway,
        hub=hub,
        charging=lambda: is_charging(status.current),
        changed=changes.notify_all,
    )


def _address(settings: BridgeSettings) -> FleetAddress:
    hub = settings.hub
    return FleetAddress(
        hub.servers,
        credentials=hub.credentials,
        ca=hub.ca,
        inbox=inbox_prefix(hub.robot),
        name=f"robot-bridge {hub.robot}",
    )
