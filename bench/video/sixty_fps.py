"""60 frames/s end to end: a film at HIGH_QUALITY, with the robot's own profile, to the decoder of a viewer.

A film has no stamps: ages and deliveries are the viewer's own, by the robot's capture times. A picture of a
film counts as captured when it is due.
"""

import json
import subprocess
import sys
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import foreign, product
from bench.video.window import delivered_of_due_percent
from console.client import PreviewProfile

ROUNDS: Final = FEWEST_ROUNDS
FPS: Final = 60
WATCH_S: Final = 8.0
LATENCY_MS: Final = 125
_FILM_S: Final = 4
_ENDS_WITHIN_S: Final = 60.0


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    film = workdir / "film.mp4"
    make_film(film)
    source = {"source": {"kind": "file", "path": str(film)}}
    ages_ms: list[float] = []
    delivered: list[float] = []
    with (
        product.robot(workdir, None, LATENCY_MS, settings=source) as robot,
        robot.preview(PreviewProfile.HIGH_QUALITY),
    ):
        for _ in range(ROUNDS):
            percent, age_ms = one_round(robot.client.target, WATCH_S)
            ages_ms.append(age_ms)
            delivered.append(percent)
            log(f"{percent:.2f} % of the frames, median age {age_ms:.1f} ms")
    found = [
        Row(
            name="video.age_60_ms",
            what="film at high-quality (720p60): due to decoded, median, by the viewer's own reckoning",
            unit="ms",
            values=ages_ms,
            bar=None,
        ),
        Row(
            name="video.age_60_delivered_percent",
            what="the same: frames decoded whole, of those captured between the first and the last",
            unit="%",
            values=delivered,
            bar=99,
            better="higher",
        ),
    ]
    return [row for row in found if row.name in wanted]


def one_round(target: str, watch_s: float) -> tuple[float, float]:
    """Watches; returns the share of frames that were delivered, in percent, and their median age in ms."""
    command = [sys.executable, "-m", "bench.video.film_viewer", target, str(watch_s)]
    timeout_s = watch_s + _ENDS_WITHIN_S
    done = subprocess.run(command, capture_output=True, text=True, timeout=timeout_s, check=True)
    found = json.loads(done.stdout)
    return delivered_of_due_percent(found["captured_ns"], FPS, watch_s), found["median_age_ms"]


def make_film(film: Path) -> None:
    pattern = f"testsrc2=size=1280x720:rate={FPS},noise=alls=6:allf=t+u"
    command = ["ffmpeg", "-v", "error", "-f", "lavfi", "-i", pattern, "-t", str(_FILM_S)]
    command += ["-c:v", "libx264", "-preset", "ultrafast", "-crf", "20", "-pix_fmt", "yuv420p", str(film)]
    subprocess.run(command, env=foreign.environment(), check=True)
