"""Assembles the service, starts its parts in order and stops them in reverse."""

import asyncio
import logging
import os
from contextlib import AbstractAsyncContextManager, nullcontext
from functools import partial
from pathlib import Path
from typing import Final, NoReturn

from common import bind, heartbeat, rpc
from common.health import Health
from common.tasks import cancel
from preview.camera_planner import CameraPlanner
from preview.camera_watch import watch_cameras
from preview.config import PreviewSettings
from preview.encoders import trial
from preview.encoders.crash_marker import CrashMarkerFile
from preview.encoders.probe import TrialProber
from preview.encoders.selection import Selection
from preview.pipeline.events import HungError
from preview.pipeline.runner import Runner
from preview.rpc.servicer import SERVICE, PreviewServicer
from preview.supervisor.supervisor import Supervisor
from preview.tap import VideoTap

_log = logging.getLogger(__name__)

EXIT_HUNG: Final = 70
"""A driver hangs, and only the end of this process frees it: the service is to be restarted."""


async def serve(settings: PreviewSettings, stop: asyncio.Event) -> None:
    """Serves until `stop`.

    Raises:
        UserError: the socket can't be used.
    """
    encoders = settings.encoders
    prober = TrialProber(partial(trial.attempt, settings.profiles.largest, encoders.probe_timeout_s))
    selection = Selection(encoders.allowed, encoders.forgive_after_s, prober)
    marker = CrashMarkerFile(settings.runtime_dir)
    marker.blame_previous(selection)
    supervisor = Supervisor(settings, selection, marker, Runner, CameraPlanner(settings).plan)
    server = rpc.new_server()
    PreviewServicer(supervisor, prober, encoders.preference).register(server)
    Health(SERVICE).register(server)
    # The tap first: from its binding on the server can be connected to, and then the whole service is up.
    async with _video_tap(settings.video_tap.socket, supervisor):
        bind.bind_unix(server, settings.socket)
        await server.start()
        heartbeat.own().ready()
        srt = settings.srt
        _log.info(
            "serving on %s; viewers reach the listener at %s, UDP port %d",
            settings.socket,
            srt.reached_at,
            srt.port,
        )
        tasks = [
            asyncio.create_task(prober.try_all(selection.order_of_trials), name="trials"),
            asyncio.create_task(watch_cameras(supervisor, settings), name="watch cameras"),
        ]
        try:
            await supervisor.run(stop)
        except HungError as error:
            _end_process(error)
        finally:
            await server.stop(rpc.STOP_GRACE_S)
            await cancel(tasks)
            await prober.close()
            settings.socket.unlink(missing_ok=True)


def _video_tap(path: Path | None, supervisor: Supervisor) -> AbstractAsyncContextManager[None]:
    """Serves the video tap for as long as the block lasts, if there is to be one."""
    return VideoTap(supervisor).serving(path) if path else nullcontext()


def _end_process(error: HungError) -> NoReturn:
    """Ends the process at once: a thread that hangs in a driver can't be joined."""
    _log.critical("%s: this process ends (code %d) to be started again", error, EXIT_HUNG)
    logging.shutdown()
    os._exit(EXIT_HUNG)
