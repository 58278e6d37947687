"""Half an hour of the preview service, and half an hour of the gateway: what they keep of what has ended.

A round of the preview service is enable, join, switch, leave and disable. libsrt keeps closed sockets and
their buffers for some seconds, and several rounds pass in each of these. A round of the gateway is operators
who come, read, watch, subscribe and go.
"""

import tempfile
import time
from collections.abc import Callable
from itertools import cycle
from pathlib import Path
from typing import Final

from bench.product import product
from bench.progress import log
from bench.rows import Row
from bench.soak.operators import come_and_go
from bench.soak.readings import FEWEST_ROUNDS, Reading, judge
from bench.video import product as sender
from bench.video.camera import camera
from bench.video.viewing import PATIENCE_S
from console.client import PreviewProfile

MINUTES: Final = 30.0
LATENCY_MS: Final = 20
OPERATORS: Final = 5
_LOG_EVERY_ROUNDS: Final = 25
_PROFILES: Final = (PreviewProfile.LOW_BW, PreviewProfile.BALANCED, PreviewProfile.HIGH_QUALITY)


def rows(_ground: None, wanted: set[str], minutes: float = MINUTES) -> list[Row]:
    found: list[Row] = []
    if {"soak.rss_growth_mib", "soak.fds_growth"} & wanted:
        found += _preview(minutes)
    if {"soak.gateway_rss_growth_mib", "soak.gateway_fds_growth"} & wanted:
        found += _gateway(minutes)
    return found


def _preview(minutes: float) -> list[Row]:
    profiles = cycle(_PROFILES)
    with (
        tempfile.TemporaryDirectory() as workdir,
        camera(Path(workdir)) as source,
        sender.robot(Path(workdir), source, LATENCY_MS) as robot,
    ):
        readings = _readings(
            lambda: _watch_video(robot, next(profiles), next(profiles)), robot.service.pid, minutes
        )
    rounds = f"enable, join, switch, leave and disable in {minutes:g} min"
    return judge(readings, "soak.", "the preview service", rounds)


def _gateway(minutes: float) -> list[Row]:
    with tempfile.TemporaryDirectory() as workdir, product(Path(workdir)) as running:
        readings = _readings(lambda: come_and_go(running.target, OPERATORS), running.gateway.pid, minutes)
    rounds = f"{OPERATORS} operators who come, read, watch, subscribe and go in {minutes:g} min"
    return judge(readings, "soak.gateway_", "the gateway", rounds)


def _readings(once: Callable[[], None], pid: int, minutes: float) -> list[Reading]:
    """Runs rounds until the time has passed, at least as many as a judgement needs; reads after each."""
    until_s = time.monotonic() + minutes * 60
    readings: list[Reading] = []
    while time.monotonic() < until_s or len(readings) < FEWEST_ROUNDS:
        once()
        readings.append(Reading.of(pid))
        if len(readings) % _LOG_EVERY_ROUNDS == 0:
            mib, descriptors = readings[-1].resident_mib, readings[-1].descriptors
            log(f"soak: round {len(readings)}, {mib:.1f} MiB, {descriptors} descriptors")
    return readings


def _watch_video(robot: sender.Robot, first: PreviewProfile, second: PreviewProfile) -> None:
    """One viewer stays from the beginning to the end, another one comes and goes after a switch."""
    with robot.preview(first), robot.viewer() as staying:
        staying.next_frame(PATIENCE_S)
        robot.client.enable_preview(second)
        with robot.viewer() as passing:
            passing.next_frame(PATIENCE_S)
        staying.next_frame(PATIENCE_S)
