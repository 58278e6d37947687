"""Passes on to the recorder what the bridge reports of copies: retention spares what is still to be copied.

Level-triggered: what counts is the newest report, not how it came about.

what happens                            what follows
the recorder does not answer            what changed waits, at most MOST_WAITING recordings, with backoff
the recorder or the bridge restarts     all that is reported is sent again
the recorder does not have it           dropped: the recording was deleted
the recorder fails                      tried again after the others, with backoff
only the number of bytes changes        sent PROGRESS_EVERY_S apart: each costs the recorder's disk a write
a call has just changed a copy          its answer counts, and for HOLDS_S no report of that copy, which
                                        may have been under way before the call
"""

import asyncio
import logging
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from typing import Final, NoReturn

from common.backoff import Backoff
from common.broadcast import Broadcast
from common.errors import (
    DomainError,
    InvalidRequestError,
    NotFoundError,
    PreconditionError,
)
from gateway.links.recorder.calls import RecorderCalls
from gateway.status.cloud import CloudView, CopyReport, RecordingCopy
from gateway.status.recording import RecorderView

_log = logging.getLogger(__name__)

MOST_WAITING: Final = 256
"""Beyond that the oldest is dropped, and comes again with a later report."""
MOST_REMEMBERED: Final = 1024
"""Recordings of which is known what the recorder has."""
PROGRESS_EVERY_S: Final = 5.0
HOLDS_S: Final = 1.5
"""The bridge reports at least every second."""
_FIRST_PAUSE_S: Final = 0.2
_LONGEST_PAUSE_S: Final = 5.0


class Copies:
    """Sends the state of each copy to the recorder.

    Args:
        recorder: takes them.
        clock: monotonic seconds.

    Attributes:
        dropped: states that were dropped because too many waited.
        failures: attempts at which the recorder did not answer or failed.
    """

    def __init__(self, recorder: RecorderCalls, clock: Callable[[], float] = time.monotonic) -> None:
        self._recorder = recorder
        self._clock = clock
        self._instances = ("", "")
        """Of the bridge and the recorder."""
        self._waiting: OrderedDict[str, RecordingCopy] = OrderedDict()
        self._sent: OrderedDict[str, tuple[RecordingCopy, float]] = OrderedDict()
        """What the recorder has, and since when."""
        self._noted_s: dict[str, float] = {}
        self._added = Broadcast()
        self.dropped = 0
        self.failures = 0

    @property
    def waiting(self) -> int:
        """States that the recorder does not have yet."""
        return len(self._waiting)

    def take(self, cloud: CloudView, recorder: RecorderView | None) -> None:
        """Takes the views of an instant. Never waits."""
        now_s = self._clock()
        self._noted_s = {each: at_s for each, at_s in self._noted_s.items() if now_s - at_s < HOLDS_S}
        report = cloud.newest
        if report is None or cloud.report is None or recorder is None or recorder.report is None:
            return
        instances = report.instance_id, recorder.report.value.instance_id
        if instances != self._instances:
            self._instances = instances
            self._sent.clear()
        for each in report.copies:
            if each.recording_id not in self._noted_s and self._is_news(each, now_s):
                self._wait(each)

    def note(self, copy: CopyReport) -> None:
        """Takes what a call has made of a copy. Never waits."""
        self._noted_s[copy.recording_id] = self._clock()
        self._wait(copy)

    async def run(self) -> NoReturn:
        """Sends what waits, until cancelled."""
        backoff = Backoff(_FIRST_PAUSE_S, _LONGEST_PAUSE_S)
        while True:
            await self._added.wait_until(lambda: bool(self._waiting))
            recording_id, copy = next(iter(self._waiting.items()))
            try:
                await self._recorder.set_copy(CopyReport(recording_id, copy))
            except (NotFoundError, PreconditionError, InvalidRequestError) as error:
                _log.info("the recorder keeps no copy state of %s: %s", recording_id, error)
            except DomainError as error:
                self.failures += 1
                if not backoff.failures:
                    _log.warning("the recorder does not take copy states: %s", error)
                if recording_id in self._waiting:
                    self._waiting.move_to_end(recording_id)
                await asyncio.sleep(backoff.next_s())
                continue
            backoff.reset()
            self._sent[recording_id] = copy, self._clock()
            self._sent.move_to_end(recording_id)
            if len(self._sent) > MOST_REMEMBERED:
                self._sent.popitem(last=False)
            # A newer state may have come meanwhile.
            if self._waiting.get(recording_id) == copy:
                del self._waiting[recording_id]

    def _is_news(self, report: CopyReport, now_s: float) -> bool:
        copy, waiting = report.copy, self._waiting.get(report.recording_id)
        if waiting is not None:
            return waiting != copy
        if report.recording_id not in self._sent:
            return True
        sent, at_s = self._sent[report.recording_id]
        only_bytes = replace(sent, bytes_done=copy.bytes_done) == copy
        return sent != copy and not (only_bytes and now_s - at_s < PROGRESS_EVERY_S)

    def _wait(self, report: CopyReport) -> None:
        self._waiting[report.recording_id] = report.copy
        if len(self._waiting) > MOST_WAITING:
            self._waiting.popitem(last=False)
            self.dropped += 1
        self._added.notify_all()
