"""Reports faults to the recorder, which keeps what happened around them."""

import asyncio
import logging
import time
from collections.abc import Callable, Iterable
from typing import Final, NoReturn

from common.backoff import Backoff
from common.broadcast import Broadcast
from common.errors import DomainError
from common.reasons import Reason
from gateway.links.recorder.calls import RecorderCalls
from gateway.status.fault import Condition, Fault, Severity
from gateway.status.faults import cloud, recording

_log = logging.getLogger(__name__)

_WITHOUT: Final = frozenset({recording.OWN, cloud.OWN})
"""Components whose faults make no incident."""
EXPIRED_S: Final = 30.0
"""After that the ring may not have the instant any more."""
_PASSING: Final = frozenset(
    {
        Reason.RECORDER_UNREACHABLE,
        Reason.RECORDER_NOT_READY,
        Reason.DISK_FULL,
        Reason.TOO_MANY_SNAPSHOTS,
    }
)
"""Refusals that may be over in seconds: the recorder tries the disk again by itself, and ends snapshots."""
_FIRST_PAUSE_S: Final = 0.2
_LONGEST_PAUSE_S: Final = 2.0


class Incidents:
    """Reports each fault when it is raised, and when it becomes more severe.

    Whether it makes an incident, the recorder's rules decide.

    What the recorder can't take at present is reported again; what it has not taken within EXPIRED_S is
    dropped. At most as many wait as faults are listed.

    Args:
        calls: to the recorder.
        clock: monotonic seconds.

    Attributes:
        expired: faults that were never reported.
    """

    def __init__(self, calls: RecorderCalls, clock: Callable[[], float] = time.monotonic) -> None:
        self._calls = calls
        self._clock = clock
        self._known: dict[str, Severity] = {}
        self._waiting: dict[str, tuple[Condition, float]] = {}
        """By fault ID: what to report, and since when."""
        self._added = Broadcast()
        self.expired = 0

    def take(self, faults: Iterable[Fault]) -> None:
        """Takes the faults of an instant. Never waits."""
        present = {
            each.condition.fault_id: each.condition
            for each in faults
            if each.active and each.condition.component not in _WITHOUT
        }
        now_s = self._clock()
        for fault_id, condition in present.items():
            known = self._known.get(fault_id)
            if known is None or condition.severity.rank > known.rank:
                self._waiting[fault_id] = condition, now_s
        self._known = {fault_id: condition.severity for fault_id, condition in present.items()}
        if self._waiting:
            self._added.notify_all()

    async def run(self) -> NoReturn:
        """Reports them, until cancelled."""
        backoff = Backoff(_FIRST_PAUSE_S, _LONGEST_PAUSE_S)
        refusal = ""
        while True:
            await self._added.wait_until(lambda: bool(self._waiting))
            fault_id, report = next(iter(self._waiting.items()))
            condition, since_s = report
            if self._clock() - since_s > EXPIRED_S:
                del self._waiting[fault_id]
                self.expired += 1
                why = refusal or "it could not be reported in time"
                _log.warning("no incident was recorded of %s within %d s: %s", fault_id, EXPIRED_S, why)
                continue
            try:
                incident = await self._calls.report_fault(condition)
            except DomainError as error:
                if error.reason in _PASSING:
                    if str(error) != refusal:
                        refusal = str(error)
                        _log.warning("no incident of %s yet, which is tried again: %s", fault_id, refusal)
                    # The others have their turn: the recorder may want no incident of them.
                    self._waiting[fault_id] = self._waiting.pop(fault_id)
                    await asyncio.sleep(backoff.next_s())
                    continue
                _log.warning("no incident was recorded of %s: %s", fault_id, error)
            else:
                if incident:
                    _log.info("fault %s: incident %s", fault_id, incident)
            backoff.reset()
            refusal = ""
            # It may have become more severe meanwhile.
            if self._waiting.get(fault_id) is report:
                del self._waiting[fault_id]
