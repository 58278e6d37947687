"""Age of the pictures in the window: the defaults, a clean link; against webrtcbin in the same rounds.

Ours is from capture to painted, read from the pixels of the window; webrtcbin's from capture to decoded, with
the same encoder settings and no window. The age that the window itself gives is compared with the stamp.
"""

import statistics
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import product, webrtc
from bench.video.camera import camera
from bench.video.viewing import watch, watch_window
from bench.video.window import Window
from bench.viewer import painted_frames

ROUNDS: Final = FEWEST_ROUNDS
SETTLE_S: Final = 3.0
WATCH_S: Final = 6.0
LATENCY_MS: Final = 125
_PERCENT: Final = 100


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    ours: list[Window] = []
    theirs_ms: list[float] = []
    errors_ms: list[float] = []
    with camera(workdir) as source, product.robot(workdir, source, LATENCY_MS) as robot:
        for _ in range(ROUNDS):
            with robot.preview():
                seen = painted_frames(robot, WATCH_S, SETTLE_S)
            ours.append(Window.of(seen, seen[0].captured_s, seen[-1].captured_s))
            off_ms = [one.error_ms for one in seen if one.error_ms is not None]
            errors_ms.append(statistics.quantiles(off_ms, n=20)[18])
            if "video.age_default" in wanted:
                with webrtc.viewer(source) as viewer:
                    watch(viewer, SETTLE_S)
                    theirs_ms.append(watch_window(viewer, WATCH_S).median_ms)
            against = f"; webrtcbin {theirs_ms[-1]:.1f} ms" if theirs_ms else ""
            log(
                f"painted after {ours[-1].median_ms:.1f} ms, 99 % within {ours[-1].p99_ms:.1f} ms; the age"
                f" shown is wrong by {statistics.median(off_ms):.2f}, 95 % by {errors_ms[-1]:.2f} ms{against}"
            )
    medians_ms = [each.median_ms for each in ours]
    what = "capture to painted in the window, defaults, clean link (720p30)"
    found = [
        Row(name="video.age_default_ms", what=f"{what}: median", unit="ms", values=medians_ms, bar=16),
        Row(
            name="video.age_default_p99_ms",
            what=f"{what}: 99th percentile",
            unit="ms",
            values=[each.p99_ms for each in ours],
            bar=30,
        ),
        Row(
            name="video.age_error_ms",
            what="age that the window shows against the stamp in its pixels: 95th percentile",
            unit="ms",
            values=errors_ms,
            bar=2,
        ),
    ]
    if theirs_ms:
        found.append(
            Row(
                name="video.age_default",
                what=f"{what}: median, against webrtcbin's capture to decoded",
                unit="ms",
                values=medians_ms,
                references=theirs_ms,
                bar=1.6,
            )
        )
    return [row for row in found if row.name in wanted]
