"""One source at work: the newest message of its topic becomes a value on the board."""

import logging
import time
from dataclasses import dataclass
from typing import Any

from gateway.config import SourceSettings
from gateway.ros.decoding import Decoder
from gateway.ros.placing import place
from gateway.ros.reception import Instant, received_at
from gateway.ros.subscribing import depth_of
from gateway.status.board import Board
from gateway.status.values import Received

log = logging.getLogger(__name__)

# A source may keep the thread (and Python's lock) for at most this share of the time: after a huge message it
# rests, so that a flood of them starves neither the other sources nor the clients.
_MAX_SHARE = 0.2
_COMPLAINT_EVERY_S = 10.0
_CLOCKS_APART_S = 50e-6
"""Between reading one clock and the other; more than that, and the thread was preempted in between."""
_CLOCK_TRIES = 3


@dataclass(frozen=True, slots=True)
class SourceCounts:
    """What became of a source's messages so far."""

    values: int
    """Messages that made it to the board."""
    without_value: int
    """Messages that held nothing usable: a speed that is not a number, for example."""
    failures: int
    """Messages that could not be read at all."""


class Source:
    """Reads one subscription. Only the sampling thread calls `take`; anybody may look at `counts`.

    Args:
        settings: the topic and how to read it.
        subscription: as `subscribe` made it.
        board: where values go.
        created_at_s: monotonic time of the subscription's creation: no message is older.
    """

    def __init__(
        self, settings: SourceSettings, subscription: Any, board: Board, *, created_at_s: float
    ) -> None:
        self._settings = settings
        self._subscription = subscription
        self._decoder = Decoder(settings, subscription.msg_type)
        self._depth = depth_of(settings)
        self._board = board
        self._emptied_at_s = created_at_s
        self._rests_until_s = created_at_s
        self._complained_at_s: float | None = None
        self._values = self._without_value = self._failures = 0

    @property
    def counts(self) -> SourceCounts:
        """What became of the messages so far."""
        return SourceCounts(self._values, self._without_value, self._failures)

    @property
    def topic(self) -> str:
        """What it reads, as configured."""
        return self._settings.topic

    @property
    def publisher_count(self) -> int:
        """How many publishers this source is connected with at this moment."""
        return int(self._subscription.get_publisher_count())

    def take(self) -> None:
        """Puts the value of the newest message on the board, if there is a new one. Never raises."""
        now = _now()
        if now.monotonic_s < self._rests_until_s:
            return
        cpu_before_s = time.thread_time()
        # As many as the queue holds, and no more: with it, all is taken that was there at `now`.
        for _ in range(self._depth):
            if not self._take_one(now):
                break
        self._emptied_at_s = now.monotonic_s
        # What it cost, not how long it took: a busy machine is no reason to look less often.
        spent_s = time.thread_time() - cpu_before_s
        self._rests_until_s = time.monotonic() + spent_s * (1 / _MAX_SHARE - 1)

    def _take_one(self, now: Instant) -> bool:
        """Whether there was a message."""
        try:
            taken = self._subscription.handle.take_message(self._subscription.msg_type, True)
            if taken is None:
                return False
            raw, info = taken
            self._hand_over(raw, received_at(info["received_timestamp"], now, self._emptied_at_s))
        except Exception as error:  # noqa: BLE001 - whatever one message or reader does wrong, sampling goes on
            self._failures += 1
            self._complain(error, now.monotonic_s)
        return True

    def _hand_over(self, raw: bytes, at_s: float) -> None:
        value = self._decoder.decode(raw)
        if value is None:
            self._without_value += 1
            return
        place(self._board, self._settings, Received(value, at_s))
        self._values += 1

    def _complain(self, error: Exception, now_s: float) -> None:
        if self._complained_at_s is not None and now_s - self._complained_at_s < _COMPLAINT_EVERY_S:
            return
        self._complained_at_s = now_s
        log.warning(
            "%s (%s): a message can't be read, %d so far: %s: %s",
            self._settings.topic,
            self._settings.type,
            self._failures,
            type(error).__name__,
            error,
        )


def _now() -> Instant:
    """Reads both clocks at one moment, as far as the scheduler allows: what lies between is an error."""
    for _ in range(_CLOCK_TRIES):
        now = Instant(time.monotonic(), time.time_ns())
        if time.monotonic() - now.monotonic_s < _CLOCKS_APART_S:
            break
    return now
