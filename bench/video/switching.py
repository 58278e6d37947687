"""A viewer watches while the profile changes under it."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from bench.progress import log
from bench.rows import Row
from bench.video import product
from bench.video.camera import camera
from bench.video.viewing import watch
from bench.video.window import longest_gap_ms
from console.client import PreviewProfile

ROUNDS = 5
SETTLE_S = 1.5
WATCH_S = 2.0
LATENCY_MS = 125
_WAY = (PreviewProfile.LOW_BW, PreviewProfile.HIGH_QUALITY, PreviewProfile.BALANCED)


def rows(workdir: Path, _wanted: set[str]) -> list[Row]:
    with camera(workdir, fps=60) as source, product.robot(workdir, source, LATENCY_MS) as robot:
        longest_ms = [_round(robot) for _ in range(ROUNDS)]
    return [
        Row(
            name="video.switch_gap_ms",
            what="longest time without a frame over the switches of profile, one SRT connection",
            unit="ms",
            values=longest_ms,
            bar=150,
        )
    ]


def _round(robot: product.Robot) -> float:
    """Through all profiles; the viewer does not call again, so a lost connection would end it."""
    gaps = []
    with robot.preview(), robot.viewer() as viewer, ThreadPoolExecutor(1) as operator:
        watch(viewer, SETTLE_S)
        for profile in _WAY:
            switching = operator.submit(robot.client.enable_preview, profile)
            seen = watch(viewer, WATCH_S)
            gaps.append(longest_gap_ms(seen, seen[0].decoded_s, seen[-1].decoded_s))
            switching.result()
    line = ", ".join(f"{gap:.0f} ms to {profile.value}" for gap, profile in zip(gaps, _WAY, strict=True))
    log(f"longest gaps: {line}")
    return max(gaps)
