"""Age of the pictures over links that lose packets: direct delivery against SRT's own, in turns.

Both watch the same robot over the same losses, in both directions, of control packets, too. Age is from the
capture, by the stamp in the frame, to the decoder.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import product
from bench.video.camera import Camera, camera
from bench.video.far_viewing import FarWatch, torn_row, watch_far
from console.receiver.delivery import DeliveryChoice
from tests.support.udp_link import Impairment

ROUNDS: Final = FEWEST_ROUNDS
SETTLE_S: Final = 2.5
WATCH_S: Final = 8.0
LATENCY_MS: Final = 125


@dataclass(frozen=True, slots=True)
class _Link:
    """A link, and what is promised of it.

    Args:
        name: begin of its rows' names.
        rtt_ms: round trip.
        loss: share of lost packets, in each direction.
        median_ms: promised median of the age; None for no promise, like the others.
        p95_ms: promised 95th percentile.
        p95_ratio: the same against SRT's own delivery.
        delivered_percent: promised share of frames.
    """

    name: str
    rtt_ms: float
    loss: float
    median_ms: float | None
    p95_ms: float | None
    p95_ratio: float | None
    delivered_percent: float

    @property
    def what(self) -> str:
        """The link, for people."""
        return f"round trip {self.rtt_ms:.0f} ms, {self.loss:.0%} loss both ways"


LINKS: Final = (
    _Link("video.age_lossy", 20, 0.03, 24, 75, 0.5, 99.5),
    _Link("video.age_very_lossy", 20, 0.10, None, None, None, 98),
    _Link("video.age_far", 80, 0.03, 60, None, None, 98),
)


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    found = []
    with camera(workdir) as source, product.robot(workdir, source, LATENCY_MS, far=True) as robot:
        for link in LINKS:
            if any(name.startswith(link.name) for name in wanted):
                found += _rows(source, robot, link, against=link.name in wanted)
    return [row for row in found if row.name in wanted]


def _rows(source: Camera, robot: product.Robot, link: _Link, *, against: bool) -> list[Row]:
    direct: list[FarWatch] = []
    theirs: list[FarWatch] = []
    for seed in range(1, ROUNDS + 1):
        direct.append(_round(source, robot, link, DeliveryChoice.DIRECT, seed))
        if against:
            theirs.append(_round(source, robot, link, DeliveryChoice.SRT, seed))
    p95s_ms = [each.window.p95_ms for each in direct]
    rows = [
        Row(
            name=f"{link.name}_ms",
            what=f"{link.what}: capture to decoded, median",
            unit="ms",
            values=[each.window.median_ms for each in direct],
            bar=link.median_ms,
        ),
        Row(
            name=f"{link.name}_p95_ms",
            what=f"{link.what}: the same, 95th percentile",
            unit="ms",
            values=p95s_ms,
            bar=link.p95_ms,
        ),
        Row(
            name=f"{link.name}_delivered_percent",
            what=f"{link.what}: frames shown whole, of those that the camera took",
            unit="%",
            values=[each.delivered_percent for each in direct],
            bar=link.delivered_percent,
            better="higher",
        ),
        torn_row(f"{link.name}_torn", link.what, direct),
    ]
    if theirs:
        rows.append(
            Row(
                name=link.name,
                what=f"{link.what}: 95th percentile against SRT's own delivery ({LATENCY_MS} ms)",
                unit="ms",
                values=p95s_ms,
                references=[each.window.p95_ms for each in theirs],
                bar=link.p95_ratio,
            )
        )
    return rows


def _round(
    source: Camera, robot: product.Robot, link: _Link, delivery: DeliveryChoice, seed: int
) -> FarWatch:
    impairment = Impairment(delay_s=link.rtt_ms / 2000, loss=link.loss, control_loss=link.loss)
    found = watch_far(
        source, robot, impairment, settle_s=SETTLE_S, watch_s=WATCH_S, delivery=delivery, seed=seed
    )
    window = found.window
    log(
        f"{link.name}, {delivery.value}: median {window.median_ms:.1f}, 95 % {window.p95_ms:.1f} ms,"
        f" {found.delivered_percent:.1f} % delivered, {found.torn} torn, freeze {found.freeze_ms:.0f} ms,"
        f" {found.delivery['given_up']} packets given up, {found.delivery['rejoins']} rejoined"
    )
    return found
