"""Finds out which cameras are there, without opening any: device nodes, cards, files and published topics.

So an operator sees that a camera has been unplugged before asking for it, and one that is plugged in again is
used at once. It looks only while a gateway watches, and not at cameras that are in use. Looking may block, at
a file on a dead network share for example: it has a deadline in a thread of its own, and then a long pause. A
look that still hangs then is waited for again, and no other begins beside it.
"""

import asyncio
import logging
import time
from collections.abc import Iterable
from functools import partial
from typing import Final, NoReturn

from preview.config import PreviewSettings, RosSource
from preview.pipeline import sources
from preview.pipeline.threads import SharedCall
from preview.supervisor.supervisor import Supervisor

_log = logging.getLogger(__name__)

LOOK_EVERY_S: Final = 2.0
LOOK_DEADLINE_S: Final = 1.0
TAP_ANSWERS_S: Final = 0.3
"""For all topics together: a camera tap that hangs must not cost the look at the other cameras its deadline.
It answers from what it knows; where it does not, it is busy, and a start finds out.
"""
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
    """Returns why cameras can't be used, by name; empty for those that can be, as far as is known.

    Those of which nothing is known, because the camera tap does not answer, are left out.
    """
    sources_by_name = settings.named_sources
    # Topics first: the time for their answers must not go by at a slow file.
    in_turn = sorted(cameras, key=lambda camera: not isinstance(sources_by_name[camera], RosSource))
    until_s = time.monotonic() + TAP_ANSWERS_S
    found = {camera: sources.camera_problem(settings, camera, until_s) for camera in in_turn}
    return {camera: problem for camera, problem in found.items() if problem is not None}
