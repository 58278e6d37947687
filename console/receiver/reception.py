"""What one connection of direct delivery does with its packets, from the socket to the decoder."""

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final, Protocol

from console.capture_time import Unwrapped, ticks_to_ns
from console.receiver.age import AgeBound
from console.receiver.delivery import Delivery, LinkStatistics
from console.receiver.options import ReceiverOptions
from console.receiver.reorder import CAPACITY, Delivered, Reorder
from console.receiver.transport_stream import AccessUnit, TransportStream

_WAIT_S: Final = 0.01
"""Longest wait for a datagram; also how late `stopping` and a lost connection may be noticed."""
_SETTLE_S: Final = 0.0003
"""What libsrt's thread takes from a datagram to a readable packet, with room for the rest of the burst."""
_REPORT_S: Final = 0.25
"""Period of the statistics, and of the wait that follows the round trip."""
_LOSS_REPORTS: Final = 4
"""Statistics over which the share of lost packets is taken: a second."""
_NARROW_PERCENT: Final = 20.0
"""Loss beyond what SRT repairs: the link is narrower than the stream."""
_BUSY_S: Final = 0.1
"""Packets come while none is longer ago."""
_FIRST_REQUEST_S: Final = 0.5
"""Without a key frame for that time at the beginning of a connection, one is requested."""
_ANSWERED_S: Final = 0.1
"""What a requested key frame takes besides the round trip: to the encoder's next frame, 67 ms at the slowest
profile, and its coding."""
_REJOIN_AFTER_S: Final = 0.2
"""The same where none can be requested: a new connection begins with one."""
_FIRST_KEY_FRAME_S: Final = 2.5
"""The same before a connection's first key frame: a sender may not send one at once, but each 2 s."""
_REPAIR_S: Final = 0.2
"""How long frames may be too old while packets behind them are there, and wait for those that come again: for
what was lost when the link became narrower. A new connection would take as long, and cost a key frame."""
_LEAST_WAIT_S: Final = 0.2
_LONGEST_WAIT_S: Final = 0.6
_FIRST_S: Final = 1.5
"""How long a connection waits longest at its beginning: SRT assumes a round trip of 100 ms and a deviation of
50 ms until it has measured (draft-sharabayko-srt-01 4.10), so it repeats a loss report only after 300 ms."""
_NS_PER_S: Final = 1_000_000_000


def wait_s(rtt_ms: float) -> float:
    """Returns how long a missing packet is waited for, in seconds.

    A retransmission comes one round trip after its loss was reported. Should it be lost, too, the report is
    repeated about a round trip and four deviations later (draft-sharabayko-srt-01 4.8.2): five round trips
    and a constant leave room for several attempts.
    """
    return min(max(_LEAST_WAIT_S, 0.15 + 5 * rtt_ms / 1000), _LONGEST_WAIT_S)


def repeat_s(longest_wait_s: float, rtt_ms: float) -> float:
    """Returns after how long without a key frame one is requested again, in seconds.

    A part of the one that was requested may be missing, and is waited for. Until that is given up, the robot
    would make another one for nothing.

    Args:
        longest_wait_s: for a missing packet.
        rtt_ms: round trip.
    """
    return rtt_ms / 1000 + _ANSWERED_S + longest_wait_s


class PacketSocket(Protocol):
    """An established connection."""

    def first_number(self) -> int:
        """Returns the number of the connection's first packet."""

    def wait(self, timeout_s: float) -> bool:
        """Waits for a datagram; returns whether one has come."""

    def receive(self) -> tuple[int, bytes] | None:
        """Returns number and payload of a packet; None when none is there."""

    def statistics(self) -> LinkStatistics:
        """Returns the statistics so far."""


class UnitSink(Protocol):
    """What decodes."""

    def record(self, payload: bytes) -> None:
        """Takes a payload of the stream, in order."""

    def push(self, unit: AccessUnit) -> bool:
        """Decodes an access unit; returns whether it was taken. Where not, a key frame is taken next."""

    def feed(self) -> None:
        """Goes on decoding what was taken; to be called often."""

    @property
    def dropped_units(self) -> int:
        """Access units so far that were not taken, or taken in vain."""

    def check(self) -> None:
        """Raises the decoder's error, if there is one."""


class Reception:
    """Orders the packets of one connection, cuts them into access units and has those decoded.

    Args:
        connection: established.
        sink: decodes.
        options: of the receiver.
        totals: figures of the connections before this one, to which its own are added.
        report: takes the figures, a few times per second.
    """

    def __init__(
        self,
        connection: PacketSocket,
        sink: UnitSink,
        options: ReceiverOptions,
        totals: Delivery,
        report: Callable[[Delivery], None],
    ) -> None:
        self._connection = connection
        self._sink = sink
        self._options = options
        self._totals = totals
        self._report = report
        self._reorder = Reorder(connection.first_number(), _LONGEST_WAIT_S)
        self._stream = TransportStream()
        self._age = AgeBound(options.max_age_s)
        self._old_s: float | None = None
        """Since when the frames that come are too old."""
        self._pts = Unwrapped()
        self._newest: AccessUnit | None = None
        self._behind = False
        """Whether the decoder was too slow, and waits for a key frame."""
        self._dropped_before = sink.dropped_units
        self._statistics: LinkStatistics | None = None
        self._report_s = 0.0
        self._settled_s = time.monotonic() + _FIRST_S
        self._arrived_s = 0.0
        """When the newest packet came."""
        self._taken_s = time.monotonic()
        """When the newest access unit was decoded, or the connection began."""
        self._window: deque[LinkStatistics] = deque(maxlen=_LOSS_REPORTS + 1)
        self._torn_s: float | None = None
        """Since when no frame can be shown."""
        self._request_s = 0.0
        """When a key frame is to be requested, while none can be shown."""
        self._requested_s = 0.0
        """When the last one was."""
        self._lost_key_frames = 0
        """Of the stream, as far as they were noted."""
        self._requested = False
        """Whether the last request is on its way."""
        self.had_data = False
        """Whether anything has arrived."""

    def run(self, stopping: threading.Event) -> None:
        """Receives until `stopping` is set, or the connection is to be made anew.

        Raises:
            SrtError: the connection is lost.
            UnknownVideoError: the stream carries video of another codec.
            StreamError: it can't be decoded.
        """
        try:
            while not stopping.is_set():
                if self._connection.wait(self._timeout_s()):
                    stopping.wait(_SETTLE_S)
                self._drain(stopping)
                self._sink.feed()
                now_s = time.monotonic()
                if self._is_too_old(now_s) or self._is_stuck(now_s) or self._needs_rejoin(now_s):
                    self._totals = replace(self._totals, rejoins=self._totals.rejoins + 1)
                    return
                if now_s >= self._report_s:
                    self._report_s = now_s + _REPORT_S
                    self._update()
                    self._sink.check()
        finally:
            self._report(self._figures())

    def _timeout_s(self) -> float:
        deadline_s = self._reorder.deadline_s
        return _WAIT_S if deadline_s is None else min(_WAIT_S, max(0.0, deadline_s - time.monotonic()))

    def _drain(self, stopping: threading.Event) -> None:
        """Takes what has come. Bounded: a sender may send as fast as this computer takes."""
        for _ in range(CAPACITY):
            packet = None if stopping.is_set() else self._connection.receive()
            if packet is None:
                break
            self.had_data = True
            self._arrived_s = time.monotonic()
            self._decode(self._reorder.put(*packet, time.monotonic()))
        self._decode(self._reorder.expire(time.monotonic()))

    def _decode(self, delivered: Sequence[Delivered]) -> None:
        for each in delivered:
            if each.missing:
                self._stream.skip(each.missing)
            self._sink.record(each.payload)
            for unit in self._stream.feed(each.payload):
                self._newest = unit
                self._behind = not self._sink.push(unit)
                if self._behind:
                    self._stream.damage()
                else:
                    self._taken_s = time.monotonic()

    def _is_too_old(self, now_s: float) -> bool:
        """Whether the newest access unit of those that have just come is too old, and repairs do not help."""
        unit, self._newest = self._newest, None
        if unit is None or unit.pts_ticks is None:
            return False
        time_s = ticks_to_ns(self._pts.ticks(unit.pts_ticks)) / _NS_PER_S
        age_s = self._options.capture.age_s(unit.pts_ticks) if self._options.capture else None
        if not self._age.exceeded(now_s, time_s, age_s):
            self._old_s = None
            return False
        if self._old_s is None:
            self._old_s = now_s
        return not self._reorder.held or now_s - self._old_s >= _REPAIR_S

    def _is_stuck(self, now_s: float) -> bool:
        """Whether packets come, but for too long no frame that can be shown.

        A link that is narrower than the stream drops some of every frame. The sender repeats them all, and
        has no room left for new ones; a new connection begins without that backlog.
        """
        if now_s - self._arrived_s > _BUSY_S:
            return False
        # Where much is lost, what is waited for does not come.
        narrow = (self._loss_percent() or 0.0) > _NARROW_PERCENT
        patience_s = self._rtt_s if narrow else _FIRST_KEY_FRAME_S
        return now_s - self._taken_s > self._options.max_age_s + patience_s

    def _needs_rejoin(self, now_s: float) -> bool:
        """Requests a key frame while no frame can be shown; returns whether only a new connection helps.

        A decoder that is too slow waits for the regular key frame: another one would take bits from all
        viewers, and make it no faster.
        """
        stream, request = self._stream, self._options.on_picture_lost
        if not stream.torn or self._behind:
            self._torn_s = None
            return False
        shown = stream.breaks > 0
        if not shown and stream.dropped_units == 0:
            return False
        if self._torn_s is None:
            self._torn_s = now_s
            # Before the first frame, the key frame that a new connection gets may be under way.
            self._request_s = now_s if shown else now_s + _FIRST_REQUEST_S
        if self._has_lost_the_answer(now_s):
            self._request_s = now_s
        if self._requested and not self._options.takes_requests():
            self._request_s = now_s
        if now_s < self._request_s:
            return False
        self._requested = request is not None and request(stream.newest_pts)
        if self._requested:
            self._requested_s = now_s
            self._request_s = now_s + repeat_s(self._reorder.wait_s, self._rtt_s * 1000)
            return False
        return now_s - self._torn_s >= (_REJOIN_AFTER_S if shown else _FIRST_KEY_FRAME_S)

    def _has_lost_the_answer(self, now_s: float) -> bool:
        """Whether a key frame was lost since the last look that may be the one that was requested.

        The robot ignores a request for which one is on its way, so another one that is lost costs nothing.
        """
        noted, self._lost_key_frames = self._lost_key_frames, self._stream.lost_key_frames
        return self._lost_key_frames > noted and now_s - self._requested_s >= self._rtt_s

    @property
    def _rtt_s(self) -> float:
        """The round trip, in seconds; 0 before it is measured."""
        return self._statistics.rtt_ms / 1000 if self._statistics else 0.0

    def _update(self) -> None:
        statistics = self._connection.statistics()
        if time.monotonic() >= self._settled_s:
            self._reorder.wait_s = wait_s(statistics.rtt_ms)
        self._statistics = statistics
        self._window.append(statistics)
        self._report(self._figures())

    def _loss_percent(self) -> float | None:
        if len(self._window) <= 1:
            return None
        first, last = self._window[0], self._window[-1]
        received, lost = last.received - first.received, last.lost - first.lost
        return min(100.0, 100 * lost / received) if received > 0 else None

    def _figures(self) -> Delivery:
        totals, found = self._totals, self._statistics
        return replace(
            totals,
            rtt_ms=found.rtt_ms if found else None,
            lost=totals.lost + (found.lost if found else 0),
            loss_percent=self._loss_percent(),
            held=self._reorder.held,
            waited=totals.waited + self._reorder.waited,
            given_up=totals.given_up + self._reorder.given_up,
            wait_ms=round(self._reorder.wait_s * 1000),
            dropped_frames=totals.dropped_frames + self._stream.dropped_units + self._not_decoded(),
        )

    def _not_decoded(self) -> int:
        return self._sink.dropped_units - self._dropped_before
