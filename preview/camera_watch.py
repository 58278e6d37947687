"""Finds out which cameras are there, without opening any: device nodes, cards, files and published topics.

So an operator sees that a camera has been unplugged before asking for it, and one that is plugged in again is
used at once. It looks only while a gateway watches, and not at cameras that are in use. Looking may block, at
a file on a dead network share for example: it has a deadline in a thread of its own, and then a long pause. A
look that still hangs then is waited for again, and no other begins beside it.
"""

import asyncio
import logging
from collections.abc import Iterable
from functools import partial
from typing import Final, NoReturn

from common.errors import UserError
from preview.config import PreviewSettings
from preview.pipeline import sources
from preview.pipeline.threads import SharedCall
from preview.supervisor import Supervisor

_log = logging.getLogger(__name__)

LOOK_EVERY_S: Final = 2.0
LOOK_DEADLINE_S: Final = 1.0
PAUSE_AFTER_HANG_S: Final = 60.0


async def watch_cameras(supervisor: Supervisor, settings: PreviewSettings) -> NoReturn:
    """Reports to the supervisor which cameras are there, until it is cancelled."""
    looks = SharedCall[dict[str, str]]()
    while True:
        pause_s = LOOK_EVERY_S
        if supervisor.is_watched:
            look = partial(problems, settings, supervisor.unused_cameras)
            try:
                found = await looks.result(look, LOOK_DEADLINE_S)
                # A look that hung may have seen a camera, minutes ago, that has come into use since.
                unused = supervisor.unused_cameras
                supervisor.cameras_found({name: found[name] for name in found if name in unused})
            except TimeoutError:
                pause_s = PAUSE_AFTER_HANG_S
            except Exception:  # noqa: BLE001  # what a driver may do is not known; the others are watched on
                _log.exception("cameras can't be looked at; that is tried again in %g s", PAUSE_AFTER_HANG_S)
                pause_s = PAUSE_AFTER_HANG_S
        await asyncio.sleep(pause_s)


def problems(settings: PreviewSettings, cameras: Iterable[str]) -> dict[str, str]:
    """Returns why cameras can't be used, by name; empty for those that can be, as far as is known."""
    found = {}
    for camera in cameras:
        try:
            sources.examine_camera(settings, camera)
        except UserError as error:
            found[camera] = str(error)
        else:
            found[camera] = ""
    return found
