"""Age of the pictures over a link that is narrower than the stream, and over one that turns bad and good."""

import time
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import product
from bench.video.camera import Camera, camera
from bench.video.far_viewing import FarWatch, torn_row, watch_far
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


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    found: list[Row] = []
    with camera(workdir, FPS) as source:
        fixed_wanted = {name for name in wanted if name.startswith("video.age_narrow_fixed")}
        changing_wanted = {name for name in wanted if name.startswith("video.age_changing")}
        if wanted - fixed_wanted - changing_wanted:
            with product.robot(workdir, source, LATENCY_MS, far=True) as robot:
                found += _adaptive_rows([_narrow(source, robot, "adaptive") for _ in range(ROUNDS)])
        if fixed_wanted:
            fixed = {"adaptive": {"enabled": False}}
            with product.robot(workdir, source, LATENCY_MS, settings=fixed, far=True) as robot:
                found += _fixed_rows([_narrow(source, robot, "fixed") for _ in range(ROUNDS)])
        if changing_wanted:
            with product.robot(workdir, source, LATENCY_MS, far=True) as robot:
                found += _changing_rows([_changing(source, robot) for _ in range(ROUNDS)])
    return [row for row in found if row.name in wanted]


def _narrow(source: Camera, robot: product.Robot, kind: str) -> FarWatch:
    """Watches from the viewer's first frame on."""
    found = watch_far(
        source,
        robot,
        Impairment(delay_s=DELAY_S, rate_kbps=LIMIT_KBPS),
        settle_s=0.0,
        watch_s=WATCH_S,
        profile=PreviewProfile.HIGH_QUALITY,
    )
    _log(f"{LIMIT_KBPS} kbit/s, {kind}", found)
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


def _worst_ms(found: FarWatch) -> float:
    return max(one.latency_ms for one in found.after(0.0).glances)


def _log(what: str, found: FarWatch) -> None:
    late = found.after(FIRST_S)
    log(
        f"{what}: worst {_worst_ms(found):.0f} ms, after {FIRST_S:g} s median {late.median_ms:.0f} ms, 95th"
        f" percentile {late.p95_ms:.0f} ms, {late.frames_per_s:.1f} fps; freeze {found.freeze_ms:.0f} ms,"
        f" {found.torn} torn, {found.redials} redials, {found.delivery['rejoins']} rejoined"
    )


def _adaptive_rows(found: list[FarWatch]) -> list[Row]:
    what = f"HIGH_QUALITY through {LIMIT_KBPS} kbit/s, adaptive"
    return [
        Row(
            name="video.age_narrow_p95_ms",
            what=f"{what}: capture to decoded, 95th percentile after the first {FIRST_S:g} s",
            unit="ms",
            values=[each.after(FIRST_S).p95_ms for each in found],
            bar=300,
        ),
        Row(
            name="video.age_narrow_worst_ms",
            what=f"{what}: the oldest frame that was ever shown",
            unit="ms",
            values=[_worst_ms(each) for each in found],
            bar=800,
            judged="worst",
        ),
        torn_row("video.age_narrow_torn", what, found),
    ]


def _fixed_rows(found: list[FarWatch]) -> list[Row]:
    what = f"HIGH_QUALITY through {LIMIT_KBPS} kbit/s, fixed bit rate"
    return [
        Row(
            name="video.age_narrow_fixed_worst_ms",
            what=f"{what}: the oldest frame that was ever shown",
            unit="ms",
            values=[_worst_ms(each) for each in found],
            bar=1000,
            judged="worst",
        ),
        torn_row("video.age_narrow_fixed_torn", what, found),
    ]


def _changing_rows(found: list[FarWatch]) -> list[Row]:
    what = f"loss 0, {_LOSS:.0%}, 0, then 8, {LIMIT_KBPS / 1000:g}, 8 Mbit/s"
    return [
        Row(
            name="video.age_changing_freeze_ms",
            what=f"{what}: longest time without a whole frame",
            unit="ms",
            values=[each.freeze_ms for each in found],
            bar=250,
        ),
        Row(
            name="video.age_changing_reconnects",
            what=f"{what}: connections beyond the first",
            unit="",
            values=[each.redials + each.delivery["rejoins"] for each in found],
            bar=0,
            judged="worst",
        ),
    ]
