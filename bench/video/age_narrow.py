"""Age of the pictures over a link that is narrower than the stream, and over one that turns bad and good.

Age is that of the picture on the screen at every moment: while no new one comes, it grows. A viewer that
stands still for three seconds shows a picture of three seconds ago, however young the next one is.
"""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import product
from bench.video.camera import Camera, camera
from bench.video.far_viewing import FarWatch, torn_row, watch_far
from bench.video.window import longest_gap_ms
from console.client import PreviewProfile
from tests.support.udp_link import Impairment, UdpLink

FPS: Final = 60
ROUNDS: Final = FEWEST_ROUNDS
WATCH_S: Final = 12.0
LATENCY_MS: Final = 125
LIMIT_KBPS: Final = 1500
DELAY_S: Final = 0.01
FIRST_S: Final = 3.0
"""After the first frame, for the bit rate to follow the link."""
_WIDE_KBPS: Final = 8000
_PHASE_S: Final = 5.0
_LOSS: Final = 0.05
_SETTLE_S: Final = 2.5


@dataclass(frozen=True, slots=True)
class _Kind:
    """A narrow link and a bit rate.

    Args:
        name: begin of its rows' names.
        queue_s: longest wait before the bottleneck.
        adaptive: whether the bit rate follows the link.
        worst_ms: promised highest age.
        p95_ms: promised 95th percentile after FIRST_S; None for no promise, and no row.
    """

    name: str
    queue_s: float
    adaptive: bool
    worst_ms: float
    p95_ms: float | None = None

    @property
    def what(self) -> str:
        """The link, for people."""
        rate = "adaptive" if self.adaptive else "fixed bit rate"
        return f"high-quality through {LIMIT_KBPS} kbit/s with a queue of {self.queue_s:g} s, {rate}"


KINDS: Final = (
    _Kind("video.age_narrow", 0.2, adaptive=True, worst_ms=800, p95_ms=300),
    _Kind("video.age_narrow_fixed", 0.2, adaptive=False, worst_ms=1000),
    _Kind("video.age_deep", 2.0, adaptive=True, worst_ms=800, p95_ms=300),
    _Kind("video.age_deep_fixed", 2.0, adaptive=False, worst_ms=1000),
)
"""What a shallow queue has no room for is lost; in a deep one, as mobile networks have, it waits."""
_FIGURES: Final = ("p95_ms", "worst_ms", "freeze_ms", "torn")
_CHANGING: Final = "video.age_changing"


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    found: list[Row] = []
    with camera(workdir, FPS) as source:
        for kind in KINDS:
            if wanted & {f"{kind.name}_{figure}" for figure in _FIGURES}:
                found += _rows(workdir, source, kind)
        if wanted & {f"{_CHANGING}_freeze_ms", f"{_CHANGING}_reconnects"}:
            with product.robot(workdir, source, LATENCY_MS, far=True) as robot:
                found += _changing_rows([_changing(source, robot) for _ in range(ROUNDS)])
    return [row for row in found if row.name in wanted]


def _rows(workdir: Path, source: Camera, kind: _Kind) -> list[Row]:
    settings = {} if kind.adaptive else {"adaptive": {"enabled": False}}
    with product.robot(workdir, source, LATENCY_MS, settings=settings, far=True) as robot:
        found = [_narrow(source, robot, kind) for _ in range(ROUNDS)]
    return _narrow_rows(kind, found)


def _narrow(source: Camera, robot: product.Robot, kind: _Kind) -> FarWatch:
    """Watches from the viewer's first frame on."""
    found = watch_far(
        source,
        robot,
        Impairment(delay_s=DELAY_S, rate_kbps=LIMIT_KBPS, queue_s=kind.queue_s),
        settle_s=0.0,
        watch_s=WATCH_S,
        profile=PreviewProfile.HIGH_QUALITY,
    )
    _log(kind.what, found)
    return found


def _changing(source: Camera, robot: product.Robot) -> FarWatch:
    """Loss 0 -> 5 -> 0 %, then the rate 8 -> 1.5 -> 8 Mbit/s."""

    def change(link: UdpLink) -> None:
        for loss, rate_kbps in ((_LOSS, _WIDE_KBPS), (0.0, _WIDE_KBPS), (0.0, LIMIT_KBPS), (0.0, _WIDE_KBPS)):
            link.impairment.loss = link.impairment.control_loss = loss
            link.impairment.rate_kbps = rate_kbps
            time.sleep(_PHASE_S)

    found = watch_far(
        source,
        robot,
        Impairment(delay_s=DELAY_S, rate_kbps=_WIDE_KBPS),
        settle_s=_SETTLE_S,
        watch_s=4 * _PHASE_S,
        profile=PreviewProfile.HIGH_QUALITY,
        while_watching=change,
    )
    _log("bad and good again", found)
    return found


def _log(what: str, found: FarWatch) -> None:
    log(
        f"{what}: on the glass {found.glass().worst_ms:.0f} ms old at worst, after {FIRST_S:g} s 95 % of the"
        f" time below {found.glass(FIRST_S).p95_ms:.0f} ms; {found.window.frames_per_s:.1f} fps, freeze"
        f" {found.freeze_ms:.0f} ms, {found.torn} torn, {found.redials} redials,"
        f" {found.delivery['rejoins']} rejoined"
    )


def _narrow_rows(kind: _Kind, found: list[FarWatch]) -> list[Row]:
    rows = [
        Row(
            name=f"{kind.name}_worst_ms",
            what=f"{kind.what}: highest age of the picture on the screen, while none comes, too",
            unit="ms",
            values=[each.glass().worst_ms for each in found],
            bar=kind.worst_ms,
            judged="worst",
        ),
        Row(
            name=f"{kind.name}_freeze_ms",
            what=f"{kind.what}: longest time without a new whole frame, from the first one on",
            unit="ms",
            values=[longest_gap_ms(each.glances, each.first_s, each.until_s) for each in found],
            bar=None,
            judged="worst",
        ),
        torn_row(f"{kind.name}_torn", kind.what, found),
    ]
    if kind.p95_ms is None:
        return rows
    return [
        Row(
            name=f"{kind.name}_p95_ms",
            what=f"{kind.what}: age of the picture on the screen in 95 % of the time, after the first"
            f" {FIRST_S:g} s",
            unit="ms",
            values=[each.glass(FIRST_S).p95_ms for each in found],
            bar=kind.p95_ms,
        ),
        *rows,
    ]


def _changing_rows(found: list[FarWatch]) -> list[Row]:
    what = f"loss 0, {_LOSS:.0%}, 0, then 8, {LIMIT_KBPS / 1000:g}, 8 Mbit/s"
    return [
        Row(
            name=f"{_CHANGING}_freeze_ms",
            what=f"{what}: longest time without a whole frame",
            unit="ms",
            values=[each.freeze_ms for each in found],
            bar=250,
            judged="worst",
        ),
        Row(
            name=f"{_CHANGING}_reconnects",
            what=f"{what}: connections beyond the first",
            unit="",
            values=[each.redials + each.delivery["rejoins"] for each in found],
            bar=0,
            judged="worst",
        ),
    ]
