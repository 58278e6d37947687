"""Statistics of the stream and its viewers, from two readings of srtsink's counters.

srtsink's property `stats` must never be read inside its signal `caller-removed`, which is emitted under the
lock that the reading takes. Here it is read from the event loop only.
"""

import time
from dataclasses import dataclass
from typing import Any, Final

from preview.pipeline.adaptive import LinkReport
from preview.pipeline.framing import Framing
from preview.values import Measurement

_SENT: Final = "packets-sent"
_SHARES: Final = {
    # srtsink's name is misleading: it counts loss reports.
    "loss_percent": "packets-sent-lost",
    "retransmitted_percent": "packets-retransmitted",
    "dropped_percent": "packets-sent-dropped",
}
"""Shares of a LinkReport, and srtsink's counters of them."""


@dataclass(frozen=True, slots=True)
class Reading:
    """All counters at one moment, in monotonic seconds.

    Args:
        at: the moment.
        frames: encoded frames.
        bytes: of the transport stream.
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


def read(framing: Framing, sink: Any) -> Reading:
    """Returns the counters of this moment."""
    stats = sink.get_property("stats")
    # Without viewers the structure has no such field.
    callers = stats.get_value("callers") if stats is not None and stats.has_field("callers") else None
    viewers = {address_of(caller.get_value("caller-address")): caller for caller in callers or ()}
    return Reading(
        at=time.monotonic(),
        frames=framing.frames,
        bytes=framing.sent_bytes,
        last_frame_age_ms=framing.last_frame_age_ms,
        rtts_ms={address: float(caller.get_value("rtt-ms")) for address, caller in viewers.items()},
        packets={
            address: {name: int(caller.get_value(name)) for name in (_SENT, *_SHARES.values())}
            for address, caller in viewers.items()
        },
    )


def measure(before: Reading, now: Reading) -> Measurement:
    """Returns the statistics of the window between two readings."""
    seconds = max(now.at - before.at, 1e-3)
    link = link_report(before, now)
    return Measurement(
        fps=(now.frames - before.frames) / seconds,
        bitrate_kbps=(now.bytes - before.bytes) * 8 / 1000 / seconds,
        viewer_count=len(now.packets),
        last_frame_age_ms=round(now.last_frame_age_ms),
        worst_rtt_ms=link.rtt_ms if link else None,
        worst_loss_percent=link.loss_percent if link else None,
    )


def link_report(before: Reading, now: Reading) -> LinkReport | None:
    """Returns the worst figures of all viewers in the window; None without viewers."""
    if not now.packets:
        return None

    def in_window(address: str, name: str) -> int:
        return now.packets[address][name] - before.packets.get(address, {}).get(name, 0)

    def worst_percent(name: str) -> float:
        sent = {address: in_window(address, _SENT) for address in now.packets}
        return max(min(100.0, 100.0 * in_window(a, name) / sent[a]) if sent[a] > 0 else 0.0 for a in sent)

    shares = {share: worst_percent(name) for share, name in _SHARES.items()}
    return LinkReport(rtt_ms=max(now.rtts_ms.values()), **shares)


def address_of(socket_address: Any) -> str:
    """Returns "HOST:PORT" of a socket address."""
    return f"{socket_address.get_address().to_string()}:{socket_address.get_port()}" if socket_address else ""
