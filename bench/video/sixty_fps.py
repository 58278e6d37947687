"""60 frames/s end to end: a film at HIGH_QUALITY, with the robot's own profile, to the decoder of a viewer.

A film has no stamps: the age is the viewer's own, by the robot's capture times. A picture of a film counts as
captured when it is due.
"""

import json
import subprocess
import sys
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import foreign, product
from console.client import PreviewProfile

ROUNDS: Final = FEWEST_ROUNDS
FPS: Final = 60
WATCH_S: Final = 8.0
LATENCY_MS: Final = 125
_FILM_S: Final = 4
_ENDS_WITHIN_S: Final = 60.0


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    film = workdir / "film.mp4"
    _make(film)
    source = {"source": {"kind": "file", "path": str(film)}}
    ages_ms: list[float] = []
    delivered_percent: list[float] = []
    with (
        product.robot(workdir, None, LATENCY_MS, settings=source) as robot,
        robot.preview(PreviewProfile.HIGH_QUALITY),
    ):
        for _ in range(ROUNDS):
            frames, seconds, age_ms = _round(robot.client.target)
            ages_ms.append(age_ms)
            delivered_percent.append(100 * frames / (seconds * FPS))
            log(f"{frames} frames in {seconds:.2f} s, median age {age_ms:.1f} ms")
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
            what="the same: frames decoded, of 60 a second",
            unit="%",
            values=delivered_percent,
            bar=99,
            better="higher",
        ),
    ]
    return [row for row in found if row.name in wanted]


def _round(target: str) -> tuple[int, float, float]:
    """Returns frames between the first and the last, the time between them, and the median age in ms."""
    robotctl = str(Path(sys.executable).parent / "robotctl")
    command = [robotctl, "view", "--headless", "--target", target, "--json"]
    command += ["--frames", str(round(FPS * WATCH_S))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=_ENDS_WITHIN_S, check=True)
    found = json.loads(done.stdout)
    frames = found["pictures"] - 1
    return frames, frames / found["fps"], found["picture_age"]["median_ms"]


def _make(film: Path) -> None:
    pattern = f"testsrc2=size=1280x720:rate={FPS},noise=alls=6:allf=t+u"
    command = ["ffmpeg", "-v", "error", "-f", "lavfi", "-i", pattern, "-t", str(_FILM_S)]
    command += ["-c:v", "libx264", "-preset", "ultrafast", "-crf", "20", "-pix_fmt", "yuv420p", str(film)]
    subprocess.run(command, env=foreign.environment(), check=True)
