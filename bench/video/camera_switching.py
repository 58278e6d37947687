"""A viewer watches while the camera changes, in turns with changes of the profile; one SRT connection each.

The cameras are readers of one and the same shared memory, so that every frame carries its capture time.
"""

from functools import partial
from pathlib import Path
from typing import Final

from bench.rows import FEWEST_ROUNDS, Row
from bench.video import product, switching
from bench.video.camera import Camera, camera

ROUNDS: Final = FEWEST_ROUNDS
LATENCY_MS: Final = 125
_CAMERAS: Final = ("front", "rear", "arm")
_WAY: Final = ("rear", "arm", "front")


def rows(workdir: Path, _wanted: set[str]) -> list[Row]:
    with camera(workdir, fps=60) as source:
        settings = {"cameras": cameras_of(source)}
        with product.robot(workdir, None, LATENCY_MS, settings=settings) as robot:
            pairs = [(camera_round_ms(robot), switching.round_ms(robot)) for _ in range(ROUNDS)]
    cameras_ms, profiles_ms = zip(*pairs, strict=True)
    return [
        Row(
            name="video.camera_switch_gap_ms",
            what="longest time without a frame while the camera changes three times, one SRT connection",
            unit="ms",
            values=cameras_ms,
            bar=400,
            judged="worst",
        ),
        Row(
            name="video.camera_against_profile",
            what="the same, against changes of the profile, in turns",
            unit="ms",
            values=cameras_ms,
            references=profiles_ms,
            bar=None,
        ),
    ]


def cameras_of(source: Camera) -> dict[str, dict[str, str]]:
    """Returns the cameras of the preview's configuration: as many readers of one camera."""
    return {name: {"kind": "gst", "description": source.source} for name in _CAMERAS}


def camera_round_ms(
    robot: product.Robot, settle_s: float = switching.SETTLE_S, apart_s: float = switching.APART_S
) -> float:
    """Returns the longest gap of one round; arguments as of `switching.round_of`."""
    changes = {name: partial(robot.client.enable_preview, camera=name) for name in _WAY}
    return switching.round_of(robot, changes, settle_s, apart_s)
