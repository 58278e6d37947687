"""HIGH_QUALITY over links that don't carry it: with the bit rate that follows the link, and without."""

import json
import subprocess
import sys
import time
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from bench.progress import log
from bench.rows import Row
from bench.video import product
from bench.video.bad_link import BadLink, bad_link, possible
from bench.video.camera import camera
from bench.video.window import Glance
from common.errors import UserError
from console.client import PreviewProfile
from tests.support.free import free_udp_port

FPS = 60
ROUNDS = 5
SETTLE_S = 8.0
"""For the first fall of the bit rate; the same without."""
WATCH_S = 20.0
LATENCY_MS = 125
LIMIT_KBPS = 1500
LOSS_PERCENT = 3


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came through a link."""

    delivered_percent: float
    """Whole frames decoded, of those the camera took."""
    freeze_ms: float
    """Longest time without a whole frame."""


@dataclass(frozen=True, slots=True)
class _Link:
    """A link, and what is promised of it.

    Args:
        name: of the row for frames; the one for freezes adds "_freeze_ms".
        what: the link, for a person.
        least_frames: adaptive against fixed.
        longest_freeze: the same.
    """

    name: str
    what: str
    least_frames: float
    longest_freeze: float
    rate_kbps: int | None = None
    loss_percent: int = 0

    @property
    def freeze_name(self) -> str:
        """Of the row for freezes."""
        return f"{self.name}_freeze_ms"


LINKS = (
    _Link(
        "video.adaptive_limited", f"HIGH_QUALITY through {LIMIT_KBPS} kbit/s", 5, 0.2, rate_kbps=LIMIT_KBPS
    ),
    # Nothing to be won where a link loses packets but has room: nothing must be lost either.
    _Link(
        "video.adaptive_lossy",
        f"HIGH_QUALITY, {LOSS_PERCENT} % random loss",
        0.98,
        3,
        loss_percent=LOSS_PERCENT,
    ),
)


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    if not possible():
        raise UserError("video.adaptive_* make networks with bad links", "Run scripts/bench as root for them")
    found = [row for link in LINKS if wanted & {link.name, link.freeze_name} for row in _rows(workdir, link)]
    return [row for row in found if row.name in wanted]


def _rows(workdir: Path, bad: _Link) -> list[Row]:
    outcomes: dict[bool, list[Outcome]] = {False: [], True: []}
    for _ in range(ROUNDS):
        for adaptive, found in outcomes.items():
            with bad_link(rate_kbps=bad.rate_kbps, loss_percent=bad.loss_percent) as link:
                outcome = _watch_through(workdir, link, adaptive=adaptive)
            found.append(outcome)
            how = "adaptive" if adaptive else "fixed"
            share, freeze = f"{outcome.delivered_percent:.1f} %", f"{outcome.freeze_ms:.0f} ms"
            log(f"{bad.name}, {how}: {share} delivered, longest freeze {freeze}")
    adapted, fixed = outcomes[True], outcomes[False]
    return [
        Row(
            name=bad.name,
            what=f"{bad.what}: frames delivered, adaptive against fixed",
            unit="%",
            values=[each.delivered_percent for each in adapted],
            references=[each.delivered_percent for each in fixed],
            bar=bad.least_frames,
            better="higher",
        ),
        Row(
            name=bad.freeze_name,
            what=f"{bad.what}: longest time without a whole frame, adaptive against fixed",
            unit="ms",
            values=[each.freeze_ms for each in adapted],
            references=[each.freeze_ms for each in fixed],
            bar=bad.longest_freeze,
        ),
    ]


def _watch_through(workdir: Path, link: BadLink, *, adaptive: bool) -> Outcome:
    port = free_udp_port()
    settings = {
        "adaptive": {"enabled": adaptive},
        "srt": {"bind": link.robot, "port": port, "latency_ms": LATENCY_MS},
    }
    with (
        camera(workdir, FPS) as source,
        product.robot(workdir, source, LATENCY_MS, settings=settings) as robot,
        robot.preview(PreviewProfile.HIGH_QUALITY),
    ):
        where = (link.robot, str(port), str(LATENCY_MS))
        command = [*link.enter, sys.executable, "-m", "bench.video.far_viewer", *where]
        begun_s = time.monotonic()
        seconds = SETTLE_S + WATCH_S
        report = subprocess.run(
            [*command, str(seconds)], stdout=subprocess.PIPE, check=True, timeout=seconds + 30
        ).stdout
        preview = robot.client.status().preview
        log(f"target at the end: {preview.target_bitrate_kbps} kbit/s {preview.bitrate_reason}")
    return _judge([Glance(*one) for one in json.loads(report)], begun_s + SETTLE_S)


def _judge(seen: list[Glance], from_s: float) -> Outcome:
    """Over `WATCH_S` from `from_s` on."""
    until_s = from_s + WATCH_S
    whole = [one for one in seen if not one.corrupt and from_s <= one.decoded_s < until_s]
    moments_s = [from_s, *(one.decoded_s for one in whole), until_s]
    freeze_s = max(later - earlier for earlier, later in pairwise(moments_s))
    return Outcome(100 * len({one.captured_s for one in whole}) / (FPS * WATCH_S), freeze_s * 1000)
