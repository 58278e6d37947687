"""Adaptive bit rate: delay-based congestion control. Pure.

Without viewers the bit rate is the profile's target. With the first one, of whose link nothing is known, it
starts low and rises by half about once a second, up to the target or until a queue begins; then it takes the
last step back (slow start, ended as by HyStart++, RFC 9406).

A congested link shows in a delay that is longer than its minimum (queue_delay.py): the age of the pictures
where viewers report it, and the round-trip time. Then the bit rate falls at once, to below the rate that was
delivered, so that the queue drains. Loss counts only where it exceeds what SRT can repair: a radio link loses
packets at any rate, and a lower one does not improve it.

The delivered rate is remembered as the one that congests the link. Far below it, the bit rate rises by a
step a second. Close to it, it first waits, longer after each attempt that failed, and then rises in small
steps. The principle is that of Google Congestion Control (draft-ietf-rmcat-gcc); the thresholds are our own,
and docs/benchmarks.md (video.adaptive_*) has what they achieve.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from common.units import bit_rate
from preview.pipeline.queue_delay import QueueDelay

_BELOW_DELIVERED: Final = 0.85
"""A decrease sets this share of the delivered rate at most, ..."""
_DRAIN_S: Final = 2.0
"""... and less where the queue would not drain within this time, ..."""
_LEAST_SHARE: Final = 0.5
"""... but at least this share of it."""
_LEAST_DELIVERED: Final = 0.4
"""A lower estimate of the delivered share is not remembered: a rate that is too low takes long to rise."""
_HOLD_AFTER_DECREASE_S: Final = 1.0
"""A lower rate takes this long to show in the statistics."""
_HOLD_OVERWHELMED_S: Final = 0.4
"""In the round trip alone it shows sooner."""
_CALM_BEFORE_INCREASE_S: Final = 2.0
_INCREASE_EVERY_S: Final = 1.0
_STEP: Final = 0.05
"""Step up, as a share of the target."""
_CLOSE: Final = 0.9
"""From this share of the rate that congested the link, the bit rate waits, and rises in small steps ..."""
_PASSED: Final = 1.1
"""... until this share of it, where that rate is forgotten."""
_SMALL_STEP: Final = 0.025
"""As a share of the bit rate."""
_START_KBPS: Final = 800
"""For the first viewer, whose link is not known: what that does not carry would make pictures old."""
_PROBE_STEP: Final = 1.5
"""Step up until a queue begins, as a factor ..."""
_PROBE_SHOWS_S: Final = 1.0
"""... that shows in the round trip after this time: the encoder follows late, and SRT reports an average."""
_REMEMBERED_S: Final = 10.0
"""Without viewers; the next one's link is then not known."""
_FIRST_WAIT_S: Final = 4.0
_LONGEST_WAIT_S: Final = 60.0
_RTT_SLACK_MS: Final = 40.0
_RTT_SLACK_SHARE: Final = 0.5
_AGE_SLACK_MS: Final = 150.0
_LOSS_PERCENT: Final = 20.0
_LOSS_SMOOTHING: Final = 0.5
"""Weight of the newest window in the average: at a low bit rate a window has few packets."""
_DROPPED_PERCENT: Final = 0.5


@dataclass(frozen=True, slots=True)
class ViewerLink:
    """Figures of the link to one viewer in one window; shares in percent of the packets sent to it.

    Args:
        rtt_ms: round-trip time.
        loss_percent: packets that were sent again. That is nearly the loss itself, while SRT's counter of
            lost packets counts each repetition of a loss report again.
        dropped_percent: packets dropped by the sender because they were too late to send (SRTO_TLPKTDROP).
    """

    rtt_ms: float
    loss_percent: float = 0.0
    dropped_percent: float = 0.0


@dataclass(frozen=True, slots=True)
class Sample:
    """What is known of one window.

    Args:
        stream_kbps: bit rate of the stream, without what was sent again.
        viewers: their links, by address.
        age_ms: time from capture to display of the viewer that is furthest behind; None: not reported. A
            viewer that waits for every packet gets older pictures where others lose them.
    """

    stream_kbps: float
    viewers: Mapping[str, ViewerLink]
    age_ms: float | None = None


@dataclass(frozen=True, slots=True)
class Decision:
    """Bit rate for the encoder.

    Args:
        bitrate_kbps: between the floor and the target.
        reason: one line for people; empty at the target, and on the way there from the start.
    """

    bitrate_kbps: int
    reason: str = ""


@dataclass(slots=True)
class _Observed:
    """What has been seen of a viewer's link."""

    rtt: QueueDelay = field(default_factory=lambda: QueueDelay(_RTT_SLACK_MS, _RTT_SLACK_SHARE))
    loss_percent: float = 0.0
    """Of the newest window, and at most the average: one bad window does not count, nor do earlier losses."""
    newest_loss_percent: float = 0.0
    dropped_percent: float = 0.0
    _average_loss_percent: float = 0.0

    def observe(self, link: ViewerLink, now: float) -> None:
        self.rtt.observe(link.rtt_ms, now)
        self._average_loss_percent += _LOSS_SMOOTHING * (link.loss_percent - self._average_loss_percent)
        self.loss_percent = min(link.loss_percent, self._average_loss_percent)
        self.newest_loss_percent = link.loss_percent
        self.dropped_percent = link.dropped_percent


class BitrateController:
    """Controls the bit rate of one encoder.

    Args:
        target_kbps: upper limit, from the profile.
        floor_kbps: lower limit.
    """

    def __init__(self, target_kbps: int, floor_kbps: int) -> None:
        self._viewers: dict[str, _Observed] = {}
        self._seen: dict[str, _Observed] = {}
        """The same of the newest window with viewers."""
        self._age: QueueDelay | None = None
        self._viewed_at = float("-inf")
        self._overwhelmed = False
        self._last_decrease_at = float("-inf")
        self._last_increase_at = float("-inf")
        self._calm_since: float | None = None
        self._congested_kbps = float("inf")
        self._wait_s = _FIRST_WAIT_S
        """Before the next attempt to exceed it."""
        self._close_since: float | None = None
        """Since when the bit rate is close to the one that congested the link."""
        self._known = False
        """Whether anything is known of the viewers' links."""
        self._carried_kbps: int | None = None
        """In the slow start: the bit rate before the last step, 0 before the first; None after it."""
        self._decision = Decision(target_kbps)
        self.retarget(target_kbps, floor_kbps)

    @property
    def decision(self) -> Decision:
        """The newest one."""
        return self._decision

    def retarget(self, target_kbps: int, floor_kbps: int) -> None:
        """Sets the limits of another profile; with viewers, the bit rate goes on from where it is."""
        self._target_kbps = target_kbps
        self._floor_kbps = min(floor_kbps, target_kbps)
        if self._known:
            self._start(self._decision.bitrate_kbps)
        else:
            self._decision = Decision(target_kbps)

    def connect(self, now: float) -> Decision:
        """Returns the bit rate for a viewer that connects, at monotonic seconds `now`."""
        self._viewed_at = now
        if not self._known:
            self._start()
        return self._decision

    def set_floor(self, floor_kbps: int) -> None:
        """Sets another lower limit; a bit rate below it rises to it with the next decision."""
        self._floor_kbps = min(floor_kbps, self._target_kbps)

    def decide(self, sample: Sample, now: float) -> Decision:
        """Returns the bit rate after a window.

        Args:
            sample: of the window.
            now: monotonic seconds.
        """
        joined = not self._viewers
        self._observe(sample, now)
        if self._viewers:
            self.connect(now)
            self._follow(sample, now, joined=joined)
        elif now - self._viewed_at >= _REMEMBERED_S:
            # Before that, a viewer whose pictures have become too old joins anew, over the same link.
            self._forget_congestion()
            self._known, self._carried_kbps = False, None
            self._decision = Decision(self._target_kbps)
        if self._decision.bitrate_kbps < self._floor_kbps:
            self._decision = Decision(
                self._floor_kbps, f"a recording holds it at {bit_rate(self._floor_kbps)} at least"
            )
        return self._decision

    def is_urgent(self, rtts_ms: Mapping[str, float], now: float) -> bool:
        """Whether the end of the window is too late for a decision.

        In the slow start it is once a queue begins. Later it is where the link has become much narrower: that
        decision sets half of the delivered rate, because what was lost meanwhile has to pass it as well.

        Args:
            rtts_ms: round-trip times now, by the viewers' addresses.
            now: monotonic seconds.
        """
        self._overwhelmed = False
        at_the_floor = self._decision.bitrate_kbps <= self._floor_kbps
        if at_the_floor or now - self._last_decrease_at < _HOLD_OVERWHELMED_S:
            return False
        known = [each for each in rtts_ms if each in self._viewers]
        self._overwhelmed = any(self._viewers[each].rtt.leaps_to(rtts_ms[each]) for each in known)
        if self._overwhelmed or not self._carried_kbps:
            return self._overwhelmed
        return any(self._viewers[each].rtt.begins_at(rtts_ms[each]) for each in known)

    def _follow(self, sample: Sample, now: float, *, joined: bool) -> None:
        """Changes the bit rate as far as the links require or permit it."""
        if signs := self._signs_of_congestion():
            self._calm_since = None
            held = now - self._last_decrease_at < _HOLD_AFTER_DECREASE_S and not self._overwhelmed
            if not held and not self._is_draining():
                self._decrease(", ".join(signs), sample.stream_kbps, now)
        elif self._carried_kbps and (queues := self._beginning_queues()):
            self._step_back(self._carried_kbps, max(queues), now)
        elif not all(delay.is_calm for delay in self._delays()):
            self._calm_since = None
        elif self._carried_kbps is not None:
            # A window may have begun without a viewer, or before the last step.
            if not joined and now - self._last_increase_at >= _PROBE_SHOWS_S:
                self._probe(now)
        else:
            self._calm_since = now if self._calm_since is None else self._calm_since
            if self._may_increase(now):
                self._increase(now)

    def _observe(self, sample: Sample, now: float) -> None:
        if sample.viewers:
            self._viewers = self._seen = {each: self._observed(each) for each in sample.viewers}
        else:
            self._viewers = {}
        for address, link in sample.viewers.items():
            self._viewers[address].observe(link, now)
        if sample.age_ms is None:
            self._age = None
        else:
            self._age = self._age or QueueDelay(_AGE_SLACK_MS)
            self._age.observe(sample.age_ms, now)

    def _observed(self, address: str) -> _Observed:
        """Returns what has been seen of a viewer's link.

        While the bit rate is lowered, a new viewer of a host is the one that left: it joins anew, over a link
        whose queue may still be full, so that its first round trip is no minimum.
        """
        if address in self._seen:
            return self._seen[address] if address in self._viewers else _Observed()
        if self._decision.bitrate_kbps < self._target_kbps:
            host = _host(address)
            left = [each for each in self._seen if _host(each) == host]
            if left:
                return self._seen.pop(left[0])
        return _Observed()

    def _delays(self) -> list[QueueDelay]:
        return [*([self._age] if self._age else []), *(viewer.rtt for viewer in self._viewers.values())]

    def _signs_of_congestion(self) -> list[str]:
        viewers = self._viewers.values()
        longest = max((viewer.rtt for viewer in viewers), key=lambda rtt: rtt.queued_ms)
        loss = max(viewer.loss_percent for viewer in viewers)
        dropped = max(viewer.dropped_percent for viewer in viewers)
        signs = [
            (any(v.rtt.is_long for v in viewers), f"RTT {longest.delay_ms:.0f} ms"),
            (loss > _LOSS_PERCENT, f"{loss:.0f} % loss"),
            (dropped > _DROPPED_PERCENT, f"{dropped:.1f} % too late to send"),
        ]
        if self._age:
            signs.insert(0, (self._age.is_long, f"pictures {self._age.delay_ms:.0f} ms old"))
        return [text for bad, text in signs if bad]

    def _beginning_queues(self) -> list[float]:
        """Returns the round-trip times that show that a queue begins."""
        rtts = [viewer.rtt for viewer in self._viewers.values()]
        return [rtt.delay_ms for rtt in rtts if rtt.begins_at(rtt.delay_ms)]

    def _is_draining(self) -> bool:
        """Whether the last decrease was enough: every queue that is left becomes shorter."""
        queues = [delay for delay in self._delays() if delay.is_long]
        return bool(queues) and all(queue.is_draining for queue in queues)

    def _decrease(self, signs: str, stream_kbps: float, now: float) -> None:
        before = self._decision.bitrate_kbps
        # An encoder may deliver less than it is set to.
        sent_kbps = min(before, stream_kbps)
        delays = self._delays()
        # Whether there is congestion takes an average; how much, the newest window says best.
        lost = max(viewer.newest_loss_percent for viewer in self._viewers.values()) / 100
        delivered = (1 - lost) * (1 - max(delay.growth for delay in delays))
        drained = 1 - max(delay.queued_ms for delay in delays) / 1000 / _DRAIN_S
        trusted = max(_LEAST_DELIVERED, delivered)
        self._congested_kbps = sent_kbps * trusted
        share = max(_LEAST_SHARE, min(_BELOW_DELIVERED, drained, _BELOW_DELIVERED * (1 - lost) / trusted))
        if self._overwhelmed:
            share, self._overwhelmed = _LEAST_SHARE, False
        after = max(self._floor_kbps, round(self._congested_kbps * share))
        self._wait_s = min(_LONGEST_WAIT_S, self._wait_s * 2 if self._close_since else self._wait_s)
        self._close_since = None
        self._last_decrease_at, self._carried_kbps = now, None
        if after < before:
            self._decision = Decision(after, f"{signs}: {bit_rate(before)} -> {bit_rate(after)}")
        elif after < self._target_kbps:
            self._decision = Decision(before, f"{signs}: at the floor of {bit_rate(before)}")

    def _start(self, proven_kbps: int = 0) -> None:
        """Begins the slow start: at what the links have carried so far, if that is known."""
        self._forget_congestion()
        self._known = True
        start_kbps = max(self._floor_kbps, min(self._target_kbps, max(_START_KBPS, proven_kbps)))
        self._carried_kbps = 0 if start_kbps < self._target_kbps else None
        self._decision = Decision(start_kbps)

    def _probe(self, now: float) -> None:
        """Takes the next step of the slow start; at the target it ends when a window has carried it."""
        before = self._decision.bitrate_kbps
        if before == self._target_kbps:
            self._carried_kbps = None
            return
        self._carried_kbps, self._last_increase_at = before, now
        self._decision = Decision(min(self._target_kbps, round(before * _PROBE_STEP)))

    def _step_back(self, carried_kbps: int, rtt_ms: float, now: float) -> None:
        """Ends the slow start at the last bit rate without a queue; what the link carries is above it."""
        before = self._decision.bitrate_kbps
        self._congested_kbps = math.sqrt(carried_kbps * before)
        self._last_decrease_at, self._calm_since, self._carried_kbps = now, None, None
        text = f"RTT {rtt_ms:.0f} ms: {bit_rate(before)} -> {bit_rate(carried_kbps)}"
        self._decision = Decision(carried_kbps, text)

    def _may_increase(self, now: float) -> bool:
        return (
            self._decision.bitrate_kbps < self._target_kbps
            and self._calm_since is not None
            and now - self._calm_since >= _CALM_BEFORE_INCREASE_S
            and now - self._last_increase_at >= _INCREASE_EVERY_S
        )

    def _increase(self, now: float) -> None:
        before = self._decision.bitrate_kbps
        close_kbps = self._congested_kbps * _CLOSE
        if before > close_kbps - 1:
            if self._close_since is None:
                self._close_since = now
            if now - self._close_since < self._wait_s:
                return
            step = before * _SMALL_STEP
        else:
            step = min(self._target_kbps * _STEP, close_kbps - before)
        after = min(self._target_kbps, before + max(1, round(step)))
        if after >= self._congested_kbps * _PASSED or after == self._target_kbps:
            self._forget_congestion()
        self._last_increase_at = now
        change = f"{bit_rate(before)} -> {bit_rate(after)}"
        reason = "" if after == self._target_kbps else f"the link is quiet: {change}"
        self._decision = Decision(after, reason)

    def _forget_congestion(self) -> None:
        self._congested_kbps = float("inf")
        self._wait_s = _FIRST_WAIT_S
        self._close_since = None


def _host(address: str) -> str:
    return address.rpartition(":")[0]
