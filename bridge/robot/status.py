"""Watches the gateway's status: the newest one, and whether the gateway is reached."""

import logging
from typing import Any, Final

from bridge.config import GatewaySettings
from bridge.robot.gateway import STATUS_SILENT_S, explained, statuses
from common.errors import UserError
from common.jittered_backoff import JitteredBackoff
from omniseer.gateway.v1.system_status_pb2 import SystemStatus

_log = logging.getLogger(__name__)

_LONGEST_PAUSE_S: Final = 10.0


class StatusReader:
    """Reads the status until cancelled.

    Args:
        settings: of the gateway.

    Attributes:
        newest: the last one that was received; None before the first.
        reachable: whether it still comes.
        error: why not, for people; empty before the first attempt has ended.
    """

    def __init__(self, settings: GatewaySettings) -> None:
        self._settings = settings
        self.newest: SystemStatus | None = None
        self.reachable = False
        self.error = ""

    @property
    def current(self) -> SystemStatus | None:
        """The newest one while the gateway is reached; None without it: what was so may have changed."""
        return self.newest if self.reachable else None

    async def run(self) -> None:
        """Reads; tries again for as long as it takes."""
        backoff = JitteredBackoff(_LONGEST_PAUSE_S)
        while True:
            try:
                async with statuses(self._settings) as responses:
                    while True:
                        self._take(await responses.read(STATUS_SILENT_S))
                        backoff.reset()
            except UserError as error:
                line = explained(error)
                if self.reachable or not backoff.failures or line != self.error:
                    _log.warning("no status from the gateway: %s", line)
                self.reachable, self.error = False, line
            await backoff.wait()

    def _take(self, response: Any) -> None:
        self.newest = response.status
        self.reachable, self.error = True, ""
