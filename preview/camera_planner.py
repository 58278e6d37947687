"""Plans cameras in threads: to look at one may block, at a file on a dead network share for example."""

import logging
from functools import partial
from typing import Final

from common.errors import UserError
from preview.config import PreviewSettings
from preview.pipeline import sources
from preview.pipeline.sources import SourcePlan
from preview.pipeline.threads import SharedCall

_log = logging.getLogger(__name__)

_REMEDY: Final = (
    "If its file is on a network share, check that the share can be reached; else plug it in again"
)


class CameraPlanner:
    """Plans the cameras of a configuration. A camera that hangs costs one thread, however often it is tried.

    Args:
        settings: of the service.
    """

    def __init__(self, settings: PreviewSettings) -> None:
        self._settings = settings
        self._calls = {name: SharedCall[SourcePlan]() for name in settings.named_sources}

    async def plan(self, camera: str) -> SourcePlan:
        """Returns the first elements for a camera; see `sources.plan_camera`.

        Raises:
            UserError: the camera can't be used, or has not answered within `timeouts.start_s`.
        """
        label = f"camera {camera}" if self._settings.cameras else "the camera"
        deadline_s = self._settings.timeouts.start_s
        try:
            work = partial(sources.plan_camera, self._settings, camera)
            return await self._calls[camera].result(work, deadline_s)
        except TimeoutError:
            what = f"{label} does not answer: to look at it took more than {deadline_s:g} s"
            raise UserError(what, _REMEDY) from None
        except UserError:
            raise
        except Exception as error:  # a defect of one camera must not end the others
            _log.exception("%s can't be planned", label)
            raise UserError(f"{label} can't be used: {error}", "The log has the details") from error
