"""Reads srtsink's statistics, and makes figures of a window out of two readings.

`stats` must never be read inside the signal `caller-removed`: srtsink emits it under the lock that the
reading takes. Here it is only read from the loop.
"""

import time
from dataclasses import dataclass
from typing import Any

from preview.pipeline.framing import Framing
from preview.values import Measurement


@dataclass(frozen=True, slots=True)
class Viewer:
    """What the listener knows of one viewer. Counts since it connected.

    Args:
        key: tells viewers apart; never leaves this process.
        rtt_ms: round trip.
        sent: packets sent.
        lost: packets reported lost.
        retransmitted: packets sent again.
        dropped: packets given up because they were too late: the send buffer could not empty in time.
    """

    key: str
    rtt_ms: float
    sent: int
    lost: int
    retransmitted: int
    dropped: int


@dataclass(frozen=True, slots=True)
class LinkReport:
    """The worst of all viewers in a window; shares in percent of the packets sent to that viewer."""

    rtt_ms: float
    loss_percent: float
    retransmitted_percent: float
    dropped_percent: float


@dataclass(frozen=True, slots=True)
class Reading:
    """All counters at one moment."""

    at: float
    pictures: int
    bytes: int
    viewers: dict[str, Viewer]


def read(framing: Framing, sink: Any) -> Reading:
    """Takes the counters of this moment."""
    stats = sink.get_property("stats")
    callers = stats.get_value("callers") if stats is not None and stats.has_field("callers") else None
    viewers = [_viewer(caller) for caller in callers or ()]
    return Reading(time.monotonic(), framing.pictures, framing.bytes, {v.key: v for v in viewers})


def measure(before: Reading, now: Reading, last_picture_at: float) -> Measurement:
    """The figures of the window between two readings."""
    seconds = max(now.at - before.at, 1e-3)
    link = link_report(before, now)
    return Measurement(
        fps=(now.pictures - before.pictures) / seconds,
        bitrate_kbps=(now.bytes - before.bytes) * 8 / 1000 / seconds,
        viewer_count=len(now.viewers),
        last_frame_age_ms=max(0, round((now.at - last_picture_at) * 1000)),
        worst_rtt_ms=link.rtt_ms if link else None,
        worst_loss_percent=link.loss_percent if link else None,
    )


def link_report(before: Reading, now: Reading) -> LinkReport | None:
    """The worst link of the window, None without viewers."""
    if not now.viewers:
        return None
    reports = [_window(before.viewers.get(key), viewer) for key, viewer in now.viewers.items()]
    return LinkReport(
        rtt_ms=max(report.rtt_ms for report in reports),
        loss_percent=max(report.loss_percent for report in reports),
        retransmitted_percent=max(report.retransmitted_percent for report in reports),
        dropped_percent=max(report.dropped_percent for report in reports),
    )


def _window(before: Viewer | None, now: Viewer) -> LinkReport:
    sent = now.sent - (before.sent if before else 0)

    def share(count: int) -> float:
        return min(100.0, 100.0 * count / sent) if sent > 0 else 0.0

    return LinkReport(
        rtt_ms=now.rtt_ms,
        loss_percent=share(now.lost - (before.lost if before else 0)),
        retransmitted_percent=share(now.retransmitted - (before.retransmitted if before else 0)),
        dropped_percent=share(now.dropped - (before.dropped if before else 0)),
    )


def _viewer(caller: Any) -> Viewer:
    address = caller.get_value("caller-address")
    return Viewer(
        key=f"{address.get_address().to_string()}:{address.get_port()}" if address else "",
        rtt_ms=float(caller.get_value("rtt-ms")),
        sent=int(caller.get_value("packets-sent")),
        lost=int(caller.get_value("packets-sent-lost")),
        retransmitted=int(caller.get_value("packets-retransmitted")),
        dropped=int(caller.get_value("packets-sent-dropped")),
    )
