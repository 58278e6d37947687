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


@dataclass(frozen=True, slots=True)
class Viewer:
    """SRT statistics of one viewer; packet counts since it connected.

    Args:
        rtt_ms: round-trip time.
        sent: packets sent.
        lost: packets reported lost.
        retransmitted: packets sent again.
        dropped: packets dropped because they were too late to send (SRTO_TLPKTDROP).
    """

    rtt_ms: float
    sent: int
    lost: int
    retransmitted: int
    dropped: int


_NEW: Final = Viewer(0.0, 0, 0, 0, 0)


@dataclass(frozen=True, slots=True)
class Reading:
    """All counters at one moment, in monotonic seconds; viewers by their address."""

    at: float
    frames: int
    bytes: int
    viewers: dict[str, Viewer]


def read(framing: Framing, sink: Any) -> Reading:
    """Returns the counters of this moment."""
    stats = sink.get_property("stats")
    # Without viewers the structure has no such field.
    callers = stats.get_value("callers") if stats is not None and stats.has_field("callers") else None
    viewers = {address_of(caller.get_value("caller-address")): _viewer(caller) for caller in callers or ()}
    return Reading(time.monotonic(), framing.frames, framing.bytes, viewers)


def measure(before: Reading, now: Reading, last_frame_at: float) -> Measurement:
    """Returns the statistics of the window between two readings."""
    seconds = max(now.at - before.at, 1e-3)
    link = link_report(before, now)
    return Measurement(
        fps=(now.frames - before.frames) / seconds,
        bitrate_kbps=(now.bytes - before.bytes) * 8 / 1000 / seconds,
        viewer_count=len(now.viewers),
        last_frame_age_ms=max(0, round((now.at - last_frame_at) * 1000)),
        worst_rtt_ms=link.rtt_ms if link else None,
        worst_loss_percent=link.loss_percent if link else None,
    )


def link_report(before: Reading, now: Reading) -> LinkReport | None:
    """Returns the worst figures of all viewers in the window; None without viewers."""
    if not now.viewers:
        return None
    windows = [(before.viewers.get(address, _NEW), viewer) for address, viewer in now.viewers.items()]
    return LinkReport(
        rtt_ms=max(after.rtt_ms for _, after in windows),
        loss_percent=max(_share(a.lost - b.lost, a.sent - b.sent) for b, a in windows),
        retransmitted_percent=max(
            _share(a.retransmitted - b.retransmitted, a.sent - b.sent) for b, a in windows
        ),
        dropped_percent=max(_share(a.dropped - b.dropped, a.sent - b.sent) for b, a in windows),
    )


def _share(count: int, sent: int) -> float:
    return min(100.0, 100.0 * count / sent) if sent > 0 else 0.0


def address_of(socket_address: Any) -> str:
    """Returns "HOST:PORT" of a socket address."""
    return f"{socket_address.get_address().to_string()}:{socket_address.get_port()}" if socket_address else ""


def _viewer(caller: Any) -> Viewer:
    return Viewer(
        rtt_ms=float(caller.get_value("rtt-ms")),
        sent=int(caller.get_value("packets-sent")),
        # srtsink's name is misleading: it counts loss reports.
        lost=int(caller.get_value("packets-sent-lost")),
        retransmitted=int(caller.get_value("packets-retransmitted")),
        dropped=int(caller.get_value("packets-sent-dropped")),
    )
