"""Everything the gateway knows, in one place: what is written by the parts, and the snapshot made of it."""

import logging
import secrets
import time
from collections.abc import Callable
from typing import Final

from common.version import project_revision, project_version
from gateway.config import GatewaySettings
from gateway.observer import Observer
from gateway.platform.boot import boot_id
from gateway.rpc.tally import Tally
from gateway.status.access import UNGUARDED, AccessView
from gateway.status.board import Board
from gateway.status.event import News
from gateway.status.events import EventLog
from gateway.status.faults.rules import FaultRules
from gateway.status.faults.tracker import FaultTracker
from gateway.status.preview import PreviewView
from gateway.status.runtime import Runtime
from gateway.status.snapshot import Identity, Snapshot, take

_log = logging.getLogger(__name__)

_RUN_ID_BYTES: Final = 8


class Knowledge:
    """Belongs to the asyncio loop; other threads write on the board only.

    Args:
        settings: what is expected.
        preview: the preview of this instant.
        tally: counts the calls.
    """

    def __init__(self, settings: GatewaySettings, preview: Callable[[], PreviewView], tally: Tally) -> None:
        faults = settings.faults
        self._identity = Identity(
            settings.name, project_version(), settings.security.insecure and not settings.security.guarded
        )
        self._rules = settings.status_rules()
        self._preview = preview
        self._tally = tally
        self._revision, self._boot_id = project_revision(), boot_id()
        self._started_s = time.monotonic()
        self._tracker = FaultTracker(faults.clear_after_ms / 1000, faults.keep_cleared_ms / 1000)
        self._observer = Observer(
            self._tracker,
            FaultRules(faults.platform_limits(), faults.startup_grace_ms / 1000, faults.expiry_days),
        )
        self.board, self.events = Board(), EventLog(secrets.token_hex(_RUN_ID_BYTES))
        self.access: AccessView = UNGUARDED
        """The state of the access of this instant."""

    def snapshot(self) -> Snapshot:
        """What is true now, from memory."""
        now_s = time.monotonic()
        return take(
            identity=self._identity,
            gateway=self._runtime(now_s),
            rules=self._rules,
            board=self.board,
            preview=self._preview(),
            events=self.events.newest(),
            faults=self._tracker.faults,
            now_s=now_s,
            access=self.access,
        )

    def observe(self, now: Snapshot) -> None:
        """Keeps the book of faults and notes what is news."""
        for news in self._observer.observe(now):
            self.note(news)

    def note(self, news: News) -> None:
        """Something has happened just now."""
        _log.info("event: %s", news.sentence or news.message)
        self.events.add(news, time.monotonic())

    def _runtime(self, now_s: float) -> Runtime:
        return Runtime(
            revision=self._revision,
            boot_id=self._boot_id,
            uptime_ms=int((now_s - self._started_s) * 1000),
            client_count=self._tally.client_count(),
            requests_served=self._tally.served,
            requests_refused=self._tally.refused,
            run_id=self.events.run_id,
        )
