"""Adaptive bit rate: congestion control by multiplicative decrease and additive increase. Pure.

A congested link gets a lower bit rate at once, by a factor; a quiet one is probed with small steps, and with
smaller ones near the rate that congested it last. A link counts as congested when the sender drops packets
(its buffer did not drain in time), when many packets are lost or sent again, or when the round-trip time has
grown well beyond its own minimum, because packets then wait in a queue. A little loss alone is no congestion:
SRT repairs it, and a lower bit rate does not improve a bad radio link. No standard prescribes the thresholds;
docs/benchmarks.md (video.adaptive_*) has what they achieve.
"""

from dataclasses import dataclass
from typing import Final

_DECREASE: Final = 0.7
_SEVERE_DECREASE: Final = 0.5
"""Applies where a large share of the packets does not arrive at all."""
_SEVERE_LOSS_PERCENT: Final = 20.0
_SEVERE_DROPPED_PERCENT: Final = 10.0
_INCREASE_SHARE: Final = 0.05
"""Step up, as a share of the target."""
_CAREFUL_FROM: Final = 0.8
"""Above this share of the rate that congested the link last, steps are divided by _CAREFUL."""
_CAREFUL: Final = 4
_HOLD_AFTER_DECREASE_S: Final = 1.0
"""A lower rate takes this long to show in the statistics."""
_QUIET_BEFORE_INCREASE_S: Final = 3.0
_INCREASE_EVERY_S: Final = 1.0
_LOSS_PERCENT: Final = 8.0
_RETRANSMITTED_PERCENT: Final = 12.0
_DROPPED_PERCENT: Final = 0.5
_RTT_GROWTH: Final = 2.5
_RTT_SLACK_MS: Final = 40.0
"""A round-trip time below its minimum plus this is never long."""
_BASELINE_DRIFT: Final = 1.02
"""Factor per window by which the minimum round-trip time rises: a robot that moved away gets a new one."""


@dataclass(frozen=True, slots=True)
class LinkReport:
    """Worst figures of all viewers' links in one window; shares in percent of the packets sent to a viewer.

    Args:
        rtt_ms: round-trip time.
        loss_percent: packets reported lost.
        retransmitted_percent: packets sent again.
        dropped_percent: packets dropped by the sender because they were too late to send (SRTO_TLPKTDROP).
        age_ms: age of the oldest picture that a viewer shows, as viewers report it; None if none does.
    """

    rtt_ms: float
    loss_percent: float
    retransmitted_percent: float
    dropped_percent: float
    age_ms: float | None = None


@dataclass(frozen=True, slots=True)
class Decision:
    """Bit rate for the encoder.

    Args:
        bitrate_kbps: between the floor and the target.
        reason: one line for people; empty at the target.
    """

    bitrate_kbps: int
    reason: str = ""


class BitrateController:
    """Controls the bit rate of one encoder.

    Args:
        target_kbps: upper limit, from the profile.
        floor_kbps: lower limit.
    """

    def __init__(self, target_kbps: int, floor_kbps: int) -> None:
        self._lowest_rtt_ms: float | None = None
        self._last_decrease_at = float("-inf")
        self._last_increase_at = float("-inf")
        self._last_congested_at = float("-inf")
        self.retarget(target_kbps, floor_kbps)

    def retarget(self, target_kbps: int, floor_kbps: int) -> None:
        """Sets the limits of another profile and starts at its target."""
        self._target_kbps = target_kbps
        self._floor_kbps = min(floor_kbps, target_kbps)
        self._too_much_kbps = target_kbps
        self._decision = Decision(target_kbps)

    def decide(self, link: LinkReport | None, now: float) -> Decision:
        """Returns the bit rate after a window.

        Args:
            link: statistics of the window; None without viewers.
            now: monotonic seconds.
        """
        if link is None:
            # The next viewer starts with the profile's own rate.
            self._lowest_rtt_ms = None
            self._decision = Decision(self._target_kbps)
            return self._decision
        signs = self._congestion(link)
        if signs:
            self._last_congested_at = now
            if now - self._last_decrease_at >= _HOLD_AFTER_DECREASE_S:
                severe = (
                    link.loss_percent > _SEVERE_LOSS_PERCENT or link.dropped_percent > _SEVERE_DROPPED_PERCENT
                )
                self._decrease(signs, _SEVERE_DECREASE if severe else _DECREASE, now)
        elif self._may_increase(now):
            self._increase(now)
        return self._decision

    def _congestion(self, link: LinkReport) -> str:
        """Returns the signs of congestion, comma-separated; empty for none."""
        self._lowest_rtt_ms = min(link.rtt_ms, (self._lowest_rtt_ms or link.rtt_ms) * _BASELINE_DRIFT)
        long_rtt_ms = max(self._lowest_rtt_ms * _RTT_GROWTH, self._lowest_rtt_ms + _RTT_SLACK_MS)
        resent = link.retransmitted_percent
        signs = [
            (link.rtt_ms > long_rtt_ms, f"RTT {link.rtt_ms:.0f} ms"),
            (link.loss_percent > _LOSS_PERCENT, f"{link.loss_percent:.0f} % loss"),
            (resent > _RETRANSMITTED_PERCENT, f"{resent:.0f} % sent again"),
            (link.dropped_percent > _DROPPED_PERCENT, f"{link.dropped_percent:.1f} % too late to send"),
        ]
        return ", ".join(text for bad, text in signs if bad)

    def _decrease(self, signs: str, factor: float, now: float) -> None:
        before = self._decision.bitrate_kbps
        after = max(self._floor_kbps, round(before * factor))
        self._too_much_kbps = before
        self._last_decrease_at = now
        if after != before:
            self._decision = Decision(after, f"{signs}: {before} -> {after} kbit/s")
        elif after < self._target_kbps:
            self._decision = Decision(after, f"{signs}: at the floor of {after} kbit/s")

    def _may_increase(self, now: float) -> bool:
        return (
            self._decision.bitrate_kbps < self._target_kbps
            and now - self._last_congested_at >= _QUIET_BEFORE_INCREASE_S
            and now - self._last_increase_at >= _INCREASE_EVERY_S
        )

    def _increase(self, now: float) -> None:
        before = self._decision.bitrate_kbps
        careful = _CAREFUL if before >= self._too_much_kbps * _CAREFUL_FROM else 1
        step = max(1, round(self._target_kbps * _INCREASE_SHARE / careful))
        after = min(self._target_kbps, before + step)
        self._last_increase_at = now
        reason = "" if after == self._target_kbps else f"the link is quiet: {before} -> {after} kbit/s"
        self._decision = Decision(after, reason)
