"""A viewer watches while the profile changes; it does not reconnect, so a lost connection fails the row."""

import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import product
from bench.video.camera import camera
from bench.video.viewing import watch
from bench.video.window import longest_gap_ms
from console.client import PreviewProfile

ROUNDS: Final = FEWEST_ROUNDS
SETTLE_S: Final = 1.5
APART_S: Final = 2.0
"""From one switch to the next."""
LATENCY_MS: Final = 125
_WAY: Final = (PreviewProfile.LOW_BW, PreviewProfile.HIGH_QUALITY, PreviewProfile.BALANCED)


def rows(workdir: Path, _wanted: set[str]) -> list[Row]:
    with camera(workdir, fps=60) as source, product.robot(workdir, source, LATENCY_MS) as robot:
        longest_ms = [round_ms(robot) for _ in range(ROUNDS)]
    return [
        Row(
            name="video.switch_gap_ms",
            what="longest time without a frame while the profile changes three times, one SRT connection",
            unit="ms",
            values=longest_ms,
            bar=150,
            judged="worst",
        )
    ]


def round_ms(robot: product.Robot, settle_s: float = SETTLE_S, apart_s: float = APART_S) -> float:
    """Returns the longest gap of one round in which the profile changes; see `round_of`."""
    changes = {each.value: partial(robot.client.enable_preview, each) for each in _WAY}
    return round_of(robot, changes, settle_s, apart_s)


def round_of(
    robot: product.Robot,
    changes: Mapping[str, Callable[[], object]],
    settle_s: float = SETTLE_S,
    apart_s: float = APART_S,
) -> float:
    """Returns the longest gap of one round, from before the first change until after the last.

    Args:
        robot: the product, its preview disabled.
        changes: by what the progress calls them.
        settle_s: time before the first change.
        apart_s: time after each change.
    """
    with robot.preview(), robot.viewer() as viewer, ThreadPoolExecutor(1) as watching:
        watch(viewer, settle_s)
        # One watch over all switches, so that no gap falls between two windows.
        begun_s = time.monotonic()
        seen = watching.submit(watch, viewer, (len(changes) + 1) * apart_s)
        switched_s = []
        for number, change in enumerate(changes.values()):
            time.sleep(max(0.0, begun_s + (number + 0.5) * apart_s - time.monotonic()))
            switched_s.append(time.monotonic())
            change()
        glances = seen.result()
    ended_s = glances[-1].decoded_s
    gaps_ms = [longest_gap_ms(glances, from_s, min(from_s + apart_s, ended_s)) for from_s in switched_s]
    whole_ms = longest_gap_ms(glances, glances[0].decoded_s, ended_s)
    line = ", ".join(f"{gap:.0f} ms to {each}" for gap, each in zip(gaps_ms, changes, strict=True))
    log(f"longest gaps: {line}; {whole_ms:.0f} ms over all")
    return whole_ms
