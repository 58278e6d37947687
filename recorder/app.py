"""Assembles the recorder, starts its parts in order and stops them in reverse."""

import asyncio
import logging
import os
import secrets
from contextlib import ExitStack
from pathlib import Path

from common import bind, heartbeat, rpc
from common.boot import boot_id
from common.health import Health
from recorder.config import RecorderSettings
from recorder.recording.assembly import build
from recorder.recording.operations import Operations
from recorder.recording.recorder import Recorder
from recorder.recording.status_reader import StatusReader
from recorder.rpc.export_connections import ExportConnections
from recorder.rpc.servicer import SERVICE, RecorderServicer
from recorder.sources import RobotSources
from recorder.store.lock import folder_lock
from recorder.store.readers import reader_threads
from recorder.writing.queue import SampleQueue

_log = logging.getLogger(__name__)

_RUN_ID_BYTES = 8


async def serve(settings: RecorderSettings, stop: asyncio.Event) -> None:
    """Records and serves until `stop`.

    Raises:
        UserError: the folder, the socket or ROS 2 can't be used.
    """
    queue = SampleQueue(settings.queue_bytes)
    with ExitStack() as locks:
        for folder in _own_folders(settings):
            locks.enter_context(folder_lock(folder))
        async with RobotSources(settings, queue) as sources:
            parts = build(
                settings,
                queue,
                sources,
                sources.latched,
                boot_id=boot_id(),
                run_id=secrets.token_hex(_RUN_ID_BYTES),
            )
            status_reader = StatusReader(parts)
            recorder = Recorder(parts, status_reader)
            operations = Operations(parts, status_reader, recorder)
            server = rpc.new_server()
            connections = ExportConnections()
            with reader_threads() as readers:
                servicer = RecorderServicer(operations, status_reader, settings, readers, connections)
                servicer.register(server)
                Health(SERVICE).register(server)
                bind.bind_unix(server, settings.socket)
                await server.start()
                heartbeat.own().ready()
                _log.info("serving on %s; recordings are in %s", settings.socket, settings.root)
                async with connections.listening(settings.socket):
                    try:
                        await recorder.run(stop)
                    finally:
                        await server.stop(rpc.STOP_GRACE_S)
                        await servicer.close()
                        settings.socket.unlink(missing_ok=True)


def _own_folders(settings: RecorderSettings) -> list[Path]:
    """Returns the folders that no other recorder may use.

    A ring of its own that can't be used is left out: it is reported by the recorder, and recordings go on.
    """
    root, *ring = dict.fromkeys(each.resolve() for each in settings.folders)
    return [root, *(each for each in ring if os.access(each if each.exists() else each.parent, os.W_OK))]
