"""The bit rate follows what the viewers' links carry. Pure: told figures and times, says a bit rate and why.

Down fast, up slowly: a congested link is left at once by a factor, a quiet one is tried with small steps, and
with smaller ones near the rate that was too much the last time. A link counts as congested when packets are
given up at the sender (its buffer could not empty in time), when many are lost or sent again, or when the
round trip has grown well beyond its own lowest value: the packets are then standing in a queue somewhere. A
little loss alone is not congestion: SRT repairs it, and a lower bit rate would not make a bad radio better.
"""

from dataclasses import dataclass
from typing import Final, Protocol

_DECREASE: Final = 0.7
_SEVERE_DECREASE: Final = 0.5
"""Where a large part of the packets does not get through at all."""
_SEVERE_LOSS_PERCENT: Final = 20.0
_SEVERE_DROPPED_PERCENT: Final = 10.0
_INCREASE_SHARE: Final = 0.05
"""Of the target, per step up."""
_CAREFUL_FROM: Final = 0.8
"""From this share of the rate at which the link was last congested, steps are small."""
_CAREFUL: Final = 4
"""How many times smaller."""
_HOLD_AFTER_DECREASE_S: Final = 1.0
"""A lower rate needs this long to show in the figures."""
_QUIET_BEFORE_INCREASE_S: Final = 3.0
_INCREASE_EVERY_S: Final = 1.0
_LOSS_PERCENT: Final = 8.0
_RETRANSMITTED_PERCENT: Final = 12.0
_DROPPED_PERCENT: Final = 0.5
_RTT_GROWTH: Final = 2.5
_RTT_SLACK_MS: Final = 40.0
"""Below its lowest value plus this, a round trip is never called long."""
_BASELINE_DRIFT: Final = 1.02
"""The lowest round trip is forgotten slowly, so that a robot that moved away gets a new one."""


class Link(Protocol):
    """The worst link of the last window."""

    @property
    def rtt_ms(self) -> float:
        """Round trip."""

    @property
    def loss_percent(self) -> float:
        """Packets reported lost."""

    @property
    def retransmitted_percent(self) -> float:
        """Packets sent again."""

    @property
    def dropped_percent(self) -> float:
        """Packets given up."""


@dataclass(frozen=True, slots=True)
class Decision:
    """What the encoder shall keep.

    Args:
        bitrate_kbps: between the floor and the target.
        reason: one line for a person; empty at the target.
    """

    bitrate_kbps: int
    reason: str = ""


class BitrateController:
    """Multiplicative decrease, additive increase.

    Args:
        target_kbps: what the profile asks for; never exceeded.
        floor_kbps: never gone below.
    """

    def __init__(self, target_kbps: int, floor_kbps: int) -> None:
        self._lowest_rtt_ms: float | None = None
        self._last_decrease_at = float("-inf")
        self._last_increase_at = float("-inf")
        self._last_trouble_at = float("-inf")
        self.retarget(target_kbps, floor_kbps)

    def retarget(self, target_kbps: int, floor_kbps: int) -> None:
        """Another profile: begins at its target."""
        self._target_kbps = target_kbps
        self._floor_kbps = min(floor_kbps, target_kbps)
        self._too_much_kbps = target_kbps
        self._decision = Decision(target_kbps)

    def decide(self, link: Link | None, now: float) -> Decision:
        """Takes the figures of the last window.

        Args:
            link: the worst viewer's; None without viewers.
            now: monotonic seconds.
        """
        if link is None:
            # Nobody watches: the next viewer begins with the profile's own rate.
            self._lowest_rtt_ms = None
            self._decision = Decision(self._target_kbps)
            return self._decision
        trouble = self._trouble(link)
        if trouble:
            self._last_trouble_at = now
            if now - self._last_decrease_at >= _HOLD_AFTER_DECREASE_S:
                self._decrease(trouble, _factor(link), now)
        elif self._may_increase(now):
            self._increase(now)
        return self._decision

    def _trouble(self, link: Link) -> str:
        """What is wrong with the link, empty when nothing is."""
        self._lowest_rtt_ms = min(link.rtt_ms, (self._lowest_rtt_ms or link.rtt_ms) * _BASELINE_DRIFT)
        long_rtt_ms = max(self._lowest_rtt_ms * _RTT_GROWTH, self._lowest_rtt_ms + _RTT_SLACK_MS)
        signs = [
            (link.rtt_ms > long_rtt_ms, f"RTT {link.rtt_ms:.0f} ms"),
            (link.loss_percent > _LOSS_PERCENT, f"{link.loss_percent:.0f} % loss"),
            (
                link.retransmitted_percent > _RETRANSMITTED_PERCENT,
                f"{link.retransmitted_percent:.0f} % sent again",
            ),
            (link.dropped_percent > _DROPPED_PERCENT, f"{link.dropped_percent:.1f} % too late to send"),
        ]
        return ", ".join(text for bad, text in signs if bad)

    def _decrease(self, trouble: str, factor: float, now: float) -> None:
        before = self._decision.bitrate_kbps
        after = max(self._floor_kbps, round(before * factor))
        self._too_much_kbps = before
        self._last_decrease_at = now
        if after == before:
            if after < self._target_kbps:
                self._decision = Decision(after, f"{trouble}: at the floor of {after} kbit/s")
            return
        self._decision = Decision(after, f"{trouble}: {before} -> {after} kbit/s")

    def _may_increase(self, now: float) -> bool:
        return (
            self._decision.bitrate_kbps < self._target_kbps
            and now - self._last_trouble_at >= _QUIET_BEFORE_INCREASE_S
            and now - self._last_increase_at >= _INCREASE_EVERY_S
        )

    def _increase(self, now: float) -> None:
        before = self._decision.bitrate_kbps
        careful = _CAREFUL if before >= self._too_much_kbps * _CAREFUL_FROM else 1
        step = max(1, round(self._target_kbps * _INCREASE_SHARE / careful))
        after = min(self._target_kbps, before + step)
        self._last_increase_at = now
        self._decision = Decision(
            after, "" if after == self._target_kbps else f"the link is quiet: {before} -> {after} kbit/s"
        )


def _factor(link: Link) -> float:
    severe = link.loss_percent > _SEVERE_LOSS_PERCENT or link.dropped_percent > _SEVERE_DROPPED_PERCENT
    return _SEVERE_DECREASE if severe else _DECREASE
