"""Statistics of the stream and its viewers, from two readings of srtsink's counters.

srtsink's property `stats` must never be read inside its signal `caller-removed`, which is emitted under the
lock that the reading takes. Here it is read from the event loop only.
"""

import time
from dataclasses import dataclass
from typing import Final

from preview.pipeline.adaptive import ViewerLink
from preview.pipeline.framing import Framing
from preview.pipeline.listener import Listener
from preview.pipeline.viewer_limit import address_of
from preview.state.values import Measurement

_ACKNOWLEDGED: Final = "packet-ack-received"
_SENT: Final = "packets-sent"
_AGAIN: Final = "packets-retransmitted"
_DROPPED: Final = "packets-sent-dropped"


@dataclass(frozen=True, slots=True)
class Reading:
    """All counters at one moment, in monotonic seconds.

    Args:
        at: the moment.
        frames: encoded frames.
        bytes: of the transport stream, since the listener started.
        last_frame_age_ms: since the capture of the newest frame.
        rtts_ms: round-trip times, by viewer's address.
        packets: srtsink's counters since the viewer connected, by viewer's address.
    """

    at: float
    frames: int
    bytes: int
    last_frame_age_ms: float
    rtts_ms: dict[str, float]
    packets: dict[str, dict[str, int]]


def read(framing: Framing, listener: Listener | None) -> Reading:
    """Returns the counters of this moment."""
    stats = listener.sink.get_property("stats") if listener else None
    # Without viewers the structure has no such field.
    callers = stats.get_value("callers") if stats is not None and stats.has_field("callers") else None
    viewers = {address_of(caller.get_value("caller-address")): caller for caller in callers or ()}
    return Reading(
        at=time.monotonic(),
        frames=framing.frames,
        bytes=listener.sent_bytes if listener else 0,
        last_frame_age_ms=framing.last_frame_age_ms,
        rtts_ms={address: float(caller.get_value("rtt-ms")) for address, caller in viewers.items()},
        packets={
            address: {name: int(caller.get_value(name)) for name in (_ACKNOWLEDGED, _SENT, _AGAIN, _DROPPED)}
            for address, caller in viewers.items()
        },
    )


def measure(before: Reading, now: Reading) -> Measurement:
    """Returns the statistics of the window between two readings."""
    seconds = max(now.at - before.at, 1e-3)
    links = viewer_links(before, now).values()
    return Measurement(
        fps=(now.frames - before.frames) / seconds,
        # Another listener counts from 0.
        bitrate_kbps=max(0, now.bytes - before.bytes) * 8 / 1000 / seconds,
        viewer_count=len(now.packets),
        last_frame_age_ms=round(now.last_frame_age_ms),
        worst_rtt_ms=max((link.rtt_ms for link in links), default=None),
        worst_loss_percent=max((link.loss_percent for link in links), default=None),
    )


def viewer_links(before: Reading, now: Reading) -> dict[str, ViewerLink]:
    """Returns the figures of each viewer's link in the window, by the viewer's address."""

    def percent(address: str, name: str) -> float:
        old = before.packets.get(address, {})
        sent, counted = (now.packets[address][each] - old.get(each, 0) for each in (_SENT, name))
        return min(100.0, 100.0 * counted / sent) if sent > 0 else 0.0

    return {
        address: ViewerLink(now.rtts_ms[address], percent(address, _AGAIN), percent(address, _DROPPED))
        for address in now.packets
    }


def measured_links(before: Reading, now: Reading) -> dict[str, ViewerLink]:
    """Returns the figures of viewers that had acknowledged something before the window.

    Until a viewer does, SRT assumes a round-trip time of 100 ms.
    """
    links = viewer_links(before, now)
    return {a: link for a, link in links.items() if before.packets.get(a, {}).get(_ACKNOWLEDGED)}
