"""CPU of the preview service for each delivered frame, against gst-launch-1.0 with the same encoder settings.

Both send the camera's frames to one viewer each. At once: in the same window, so that what else the machine
does, and how warm its caches are, is the same for both. In turns: each alone on the machine. A sender that
loses frames needs less, so a round in which either side misses too many is discarded.
"""

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from bench.processes import cpu_seconds
from bench.progress import log
from bench.rows import Row
from bench.video import product, reference
from bench.video.camera import Camera, camera
from bench.video.viewing import Connect, Viewer, watch, watch_window
from tests.support.free import free_udp_port

ROUNDS: Final = 7
TRIES: Final = 14
"""Rounds at most, to get that many that count."""
WINDOW_S: Final = 8.0
LEAST_DELIVERED_PERCENT: Final = 99.0
SETTLE_S: Final = 2.5
LATENCY_MS: Final = 125


@dataclass(frozen=True, slots=True)
class Sending:
    """One sender in one window."""

    ms_per_frame: float
    delivered_percent: float


@dataclass(frozen=True, slots=True)
class _Side:
    """A sender, and its viewer.

    Args:
        sender: sends until its block ends.
        pid: process of the sender, asked while it sends.
        connect: connects the viewer.
    """

    sender: AbstractContextManager[Any]
    pid: Callable[[Any], int]
    connect: Connect


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    ways = {
        "video.cpu": (_at_once, "at once"),
        "video.cpu_in_turns": (_in_turns, "in turns"),
    }
    with (
        camera(workdir) as source,
        product.robot(workdir, source, LATENCY_MS, settings=product.FIXED_RATE) as robot,
    ):
        return [_row(name, *way, source, robot) for name, way in ways.items() if name in wanted]


_Way = Callable[[Camera, _Side, _Side], list[Sending]]


def _row(name: str, measure: _Way, how: str, source: Camera, robot: product.Robot) -> Row:
    rounds: list[list[Sending]] = []
    discarded = 0
    while len(rounds) < ROUNDS:
        if len(rounds) + discarded == TRIES:
            raise RuntimeError(f"{name}: frames were missing in {discarded} rounds: the machine is too busy")
        found = measure(source, *_sides(source, robot))
        line = ", ".join(f"{one.ms_per_frame:.2f} ms ({one.delivered_percent:.1f} %)" for one in found)
        complete = all(one.delivered_percent >= LEAST_DELIVERED_PERCENT for one in found)
        log(f"{name}: reference, ours: {line} per frame{'' if complete else '; discarded'}")
        if complete:
            rounds.append(found)
        else:
            discarded += 1
    return Row(
        name=name,
        what=f"CPU per delivered frame, preview service against gst-launch-1.0 with its encoder, {how}",
        unit="ms",
        values=[ours.ms_per_frame for _, ours in rounds],
        references=[theirs.ms_per_frame for theirs, _ in rounds],
        discarded=discarded,
        bar=1.05,
    )


def _sides(source: Camera, robot: product.Robot) -> tuple[_Side, _Side]:
    port = free_udp_port()
    sender = reference.sender(source, port, LATENCY_MS, reference.same_encoder())
    return (
        _Side(sender, lambda process: int(process.pid), lambda: reference.viewer(port, LATENCY_MS)),
        _Side(robot.preview(), lambda _: robot.service.pid, robot.viewer),
    )


def _at_once(source: Camera, theirs: _Side, ours: _Side) -> list[Sending]:
    with (
        theirs.sender as reference_process,
        theirs.connect() as reference_viewer,
        ours.sender as preview,
        ours.connect() as viewer,
        ThreadPoolExecutor(2) as viewers,
    ):
        pairs = ((theirs.pid(reference_process), reference_viewer), (ours.pid(preview), viewer))
        begun: list[Future[Any]] = [viewers.submit(watch, each, SETTLE_S) for _, each in pairs]
        for each in begun:
            each.result()
        return list(viewers.map(lambda pair: _measure(source, *pair), pairs))


def _in_turns(source: Camera, theirs: _Side, ours: _Side) -> list[Sending]:
    found = []
    for side in (theirs, ours):
        with side.sender as sending, side.connect() as viewer:
            watch(viewer, SETTLE_S)
            found.append(_measure(source, side.pid(sending), viewer))
    return found


def _measure(source: Camera, pid: int, viewer: Viewer) -> Sending:
    """Returns the CPU of a sender for each frame of a window that reaches its viewer."""
    with ThreadPoolExecutor(1) as meter:
        spent_s = meter.submit(_cpu_s, pid)
        window = watch_window(viewer, WINDOW_S)
    delivered_percent = window.delivered_percent(source.captured(window.from_s, window.until_s))
    return Sending(spent_s.result() * 1000 / len(window.glances), delivered_percent)


def _cpu_s(pid: int) -> float:
    before_s = cpu_seconds(pid)
    time.sleep(WINDOW_S)
    return cpu_seconds(pid) - before_s
