"""What the tables of docs/benchmarks.md can't show: how they come about, and why a row misses its bar."""

from collections.abc import Mapping
from typing import Final

REMARKS: Final[Mapping[tuple[str, ...], str]] = {
    ("video.first_frame",): (
        "the reference waits for its next key frame, one a second, so its single waits are anything between"
        " 180 and 1040 ms. Both are connected to at moments spread evenly over that second."
    ),
    ("video.first_frame_ten_ms",): (
        "srtsink listens with a backlog of 1, so some of ten simultaneous SRT handshakes are refused; these"
        " viewers redial after 100 ms, and the slowest shows it."
    ),
    ("soak.rss_growth_mib",): (
        "resident memory moves between 93 and 123 MiB with what libsrt holds for the last few seconds; the"
        " lowest figures of an early and of the last window are compared."
    ),
}
"""Text by the rows that it is about. A published row that misses its bar has one, with the reason."""
