"""How packets get from the network to the decoder: the choice, and what is reported of it."""

from dataclasses import dataclass
from enum import Enum


class DeliveryChoice(Enum):
    """What the user asks for; the values are those of the option `--delivery`."""

    AUTO = "auto"
    """Direct where libsrt permits it, else SRT's own."""
    DIRECT = "direct"
    """As packets arrive; an error where libsrt does not permit it."""
    SRT = "srt"
    """At SRT's latency (TSBPD), as plain players do."""


@dataclass(frozen=True, slots=True)
class LinkStatistics:
    """Statistics of one connection.

    Args:
        rtt_ms: round trip, smoothed.
        lost: packets that were missing at first; most of them come by retransmission.
        received: packets that have come, retransmissions included.
    """

    rtt_ms: float
    lost: int
    received: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Delivery:
    """The delivery in use, with its figures; those of SRT's own delivery are not known here.

    Args:
        kind: DIRECT or SRT.
        reason: why it is not direct, although that was not ruled out.
        remedy: what to do, or to type, so that it is; empty without a reason.
        rtt_ms: round trip, smoothed; None before the first connection.
        lost: packets that were missing at first.
        loss_percent: share of the packets of the last second that were missing at first; None before one.
        held: packets that wait for an earlier one now.
        waited: packets that had to wait for an earlier one.
        given_up: packets that were not waited for any longer.
        wait_ms: longest wait for a missing packet at this round trip.
        dropped_frames: frames that were not decoded, because they, or one that they depend on, were damaged.
        rejoins: how often the connection was made anew, because the frames had become too old.
    """

    kind: DeliveryChoice
    reason: str = ""
    remedy: str = ""
    rtt_ms: float | None = None
    lost: int = 0
    loss_percent: float | None = None
    held: int = 0
    waited: int = 0
    given_up: int = 0
    wait_ms: int = 0
    dropped_frames: int = 0
    rejoins: int = 0
