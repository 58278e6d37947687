"""Puts the service together, starts its parts in order and stops them in reverse."""

import asyncio
import logging
import os
from collections.abc import Sequence
from typing import Final

from common import bind, rpc
from common.health import Health
from preview.config import PreviewSettings
from preview.encoders.catalogue import CATALOGUE, Encoder
from preview.encoders.crash_marker import EncoderNote
from preview.encoders.crash_report import CrashReport
from preview.encoders.probe import Prober
from preview.encoders.selection import Selection
from preview.planner import Planner
from preview.rpc.servicer import SERVICE, PreviewServicer
from preview.supervisor import Supervisor
from preview.values import Target

_log = logging.getLogger(__name__)

EXIT_HUNG: Final = 70
"""A driver hangs so that only the end of this process frees it: start the service again."""


async def serve(settings: PreviewSettings, stop: asyncio.Event) -> None:
    """Serves until `stop`.

    Raises:
        UserError: the socket can't be used.
    """
    note = EncoderNote(settings.runtime_dir)
    selection = Selection(allowed(settings), settings.encoders.forgive_after_s)
    note.tell(selection, crash=CrashReport(settings.runtime_dir).begin())
    prober = new_prober(settings)
    planner = Planner(settings, prober, selection)
    manager = Supervisor(settings, planner, note, on_hung=lambda name, why: _end_hung(note, name, why))
    server = rpc.new_server()
    servicer = PreviewServicer(manager, prober, preference(settings))
    servicer.register(server)
    Health(SERVICE).register(server)
    bind.bind_unix(server, settings.socket)
    await server.start()
    _log.info("serving on %s", settings.socket)
    trials = asyncio.create_task(prober.try_all(selection.order), name="trials")
    try:
        await manager.run(stop)
    finally:
        await server.stop(rpc.STOP_GRACE_S)
        trials.cancel()
        await asyncio.gather(trials, return_exceptions=True)
        await prober.close()
        settings.socket.unlink(missing_ok=True)


def new_prober(settings: PreviewSettings) -> Prober:
    """Tries encoders with the largest pictures that any profile asks for."""
    return Prober(_largest(settings), settings.encoders.probe_timeout_s)


def allowed(settings: PreviewSettings) -> Sequence[Encoder]:
    """The encoders that may be used, best first."""
    return [CATALOGUE[name] for name in settings.encoders.allowed]


def preference(settings: PreviewSettings) -> Sequence[Encoder]:
    """All encoders: those that may be used, then the rest of the catalogue."""
    first = allowed(settings)
    return [*first, *(encoder for encoder in CATALOGUE.values() if encoder not in first)]


def _largest(settings: PreviewSettings) -> Target:
    return max(settings.profiles.targets.values(), key=lambda t: (t.width_px * t.height_px, t.fps))


def _end_hung(note: EncoderNote, name: str, why: str) -> None:
    """Ends the process at once: a thread that hangs in a driver can't be waited for."""
    if name:
        note.leave(name, why)
    _log.critical("%s: this process ends (code %d) to be started again", why, EXIT_HUNG)
    logging.shutdown()
    os._exit(EXIT_HUNG)
