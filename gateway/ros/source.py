"""One source at work: the newest message of its topic becomes a value on the board."""

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rclpy.serialization import deserialize_message

from common.receive_time import Instant, present_instant, received_at
from gateway.config import SourceSettings
from gateway.ros.list_truncation import truncate_list
from gateway.ros.readers import is_header_and_list, reader_for
from gateway.ros.readers.field_path import steps_of
from gateway.status.board import Board
from gateway.status.values import Received

log = logging.getLogger(__name__)

# Largest share of the thread's time (and of Python's lock) that one source may take: after a huge message it
# pauses, so that a flood of them starves neither the other sources nor the clients.
_MAX_SHARE = 0.2
_WARN_EVERY_S = 10.0


@dataclass(slots=True)
class SourceCounts:
    """Outcome of a source's messages so far."""

    values: int = 0
    """Messages that became a value."""
    without_value: int = 0
    """Messages that held nothing usable: a velocity of NaN, for example."""
    failures: int = 0
    """Messages that could not be decoded."""


class Source:
    """Reads one subscription. Only the sampling thread calls `take`; any thread may read `counts`.

    Args:
        settings: the topic and how to read it.
        subscription: as `subscribe` returns it.
        board: where values go.
        created_at_s: monotonic time of the subscription's creation: no message is older.
    """

    def __init__(
        self, settings: SourceSettings, subscription: Any, board: Board, *, created_at_s: float
    ) -> None:
        self._settings = settings
        self._spec = settings.spec
        self._subscription = subscription
        self._decode = _decoder_of(settings, subscription.msg_type)
        self._board = board
        self._emptied_at_s = created_at_s
        self._paused_until_s = created_at_s
        self._warned_at_s: float | None = None
        self.counts = SourceCounts()

    @property
    def topic(self) -> str:
        """The topic as configured."""
        return self._settings.topic

    @property
    def publisher_count(self) -> int:
        """Number of publishers that this source is connected with."""
        return int(self._subscription.get_publisher_count())

    def take(self) -> None:
        """Puts the value of the newest message on the board, if there is a new one. Never raises."""
        now = present_instant()
        if now.monotonic_s < self._paused_until_s:
            return
        cpu_before_s = time.thread_time()
        # As many as the queue holds and no more: then everything that was there at `now` is taken.
        for _ in range(self._spec.queue_depth):
            if not self._take_one(now):
                break
        self._emptied_at_s = now.monotonic_s
        # CPU time, not elapsed time: a busy machine is no reason to sample less often.
        spent_s = time.thread_time() - cpu_before_s
        self._paused_until_s = time.monotonic() + spent_s * (1 / _MAX_SHARE - 1)

    def _take_one(self, now: Instant) -> bool:
        """Returns whether there was a message."""
        try:
            taken = self._subscription.handle.take_message(self._subscription.msg_type, True)
            if taken is None:
                return False
            raw, info = taken
            self._hand_over(raw, received_at(info["received_timestamp"], now, self._emptied_at_s))
            self._board.undecodable.discard(self._spec)
        except Exception as error:  # noqa: BLE001  # one bad message or reader must not end the sampling
            self.counts.failures += 1
            self._board.undecodable.add(self._spec)
            self._warn(error, now.monotonic_s)
        return True

    def _hand_over(self, raw: bytes, at_s: float) -> None:
        value = self._decode(raw)
        if value is None:
            self.counts.without_value += 1
            return
        # The one place where a value passes from this thread to the others.
        self._board[self._spec] = Received(value, at_s)
        self.counts.values += 1

    def _warn(self, error: Exception, now_s: float) -> None:
        if self._warned_at_s is not None and now_s - self._warned_at_s < _WARN_EVERY_S:
            return
        self._warned_at_s = now_s
        log.warning(
            "%s (%s): a message can't be read, %d so far: %s: %s",
            self._settings.topic,
            self._settings.type,
            self.counts.failures,
            type(error).__name__,
            error,
        )


def _decoder_of(source: SourceSettings, message_type: Any) -> Callable[[bytes], Any]:
    """Returns the function that makes a value of a message; None of one that holds nothing usable.

    Errors of the deserialiser pass.
    """
    read, max_items, add_truncated = reader_for(source), max_list_items(source), source.spec.add_truncated

    def decode(raw: bytes) -> Any:
        raw, truncated = truncate_list(raw, max_items) if max_items else (raw, 0)
        value = read(deserialize_message(raw, message_type), source)
        return add_truncated(value, truncated) if truncated and add_truncated and value else value

    return decode


def max_list_items(source: SourceSettings) -> int | None:
    """Returns the length to truncate lists to; None if the message is not a header and a list."""
    if not is_header_and_list(source):
        return None
    if source.field is not None:
        # One item is read at the most, and those before it must be decoded, too.
        return (steps_of(source.field)[0].index or 0) + 1
    return source.spec.max_items or source.max_items
