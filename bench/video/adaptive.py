"""high-quality with the adaptive bit rate over bad links, against low-bw with a fixed one.

low-bw is what an operator would choose by hand for such a link. The link is a relay of the benchmarks' own
(tests/support/udp_link.py): 20 ms each way, and either a bottleneck or random losses in both directions, of
SRT's control packets, too. Both profiles are measured in every round, over the same losses.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import product
from bench.video.camera import Camera, camera
from bench.video.far_viewing import watch_far
from console.client import PreviewProfile
from tests.support.udp_link import Impairment

FPS: Final = 60
ROUNDS: Final = FEWEST_ROUNDS
SETTLE_S: Final = 8.0
"""For the first decreases of the bit rate; the same without."""
WATCH_S: Final = 20.0
LATENCY_MS: Final = 125
DELAY_S: Final = 0.02
LIMIT_KBPS: Final = 1500
LOSS: Final = 0.03


@dataclass(frozen=True, slots=True)
class Outcome:
    """What passed a link in one window.

    Args:
        frames_per_s: decoded whole.
        freeze_ms: longest time without a whole frame.
        frame_kbit: bits that passed the link for each whole frame, repeated packets included.
    """

    frames_per_s: float
    freeze_ms: float
    frame_kbit: float


@dataclass(frozen=True, slots=True)
class _Link:
    """A link, and what is promised of it.

    Args:
        name: of the row for frames; the others add "_freeze_ms" and "_frame_kbit".
        what: the link, for people.
        impairment: of the link.
        least_frames: promised ratio of the frames.
        longest_freeze: promised ratio of the freezes; None for no promise.
    """

    name: str
    what: str
    impairment: Impairment
    least_frames: float
    longest_freeze: float | None


LINKS: Final = (
    _Link(
        "video.adaptive_limited",
        f"{LIMIT_KBPS} kbit/s",
        Impairment(delay_s=DELAY_S, rate_kbps=LIMIT_KBPS),
        least_frames=2.0,
        longest_freeze=None,
    ),
    _Link(
        "video.adaptive_lossy",
        f"{LOSS:.0%} random loss both ways",
        Impairment(delay_s=DELAY_S, loss=LOSS, control_loss=LOSS),
        least_frames=3.0,
        longest_freeze=1.5,
    ),
)


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    with camera(workdir, FPS) as source:
        found = [
            row
            for link in LINKS
            if any(name.startswith(link.name) for name in wanted)
            for row in _rows(workdir, source, link)
        ]
    return [row for row in found if row.name in wanted]


def _rows(workdir: Path, source: Camera, bad: _Link) -> list[Row]:
    adaptive: list[Outcome] = []
    fixed: list[Outcome] = []
    fixed_rate = {"adaptive": {"enabled": False}}
    with (
        product.robot(workdir, source, LATENCY_MS, far=True) as ours,
        product.robot(workdir, source, LATENCY_MS, settings=fixed_rate, far=True) as rival,
    ):
        for number in range(ROUNDS):
            adaptive.append(_watch_through(source, ours, PreviewProfile.HIGH_QUALITY, bad, number))
            fixed.append(_watch_through(source, rival, PreviewProfile.LOW_BW, bad, number))
    against = "high-quality adaptive against low-bw fixed"
    return [
        Row(
            name=bad.name,
            what=f"{bad.what}: whole frames a second, {against}",
            unit="fps",
            values=[each.frames_per_s for each in adaptive],
            references=[each.frames_per_s for each in fixed],
            bar=bad.least_frames,
            better="higher",
        ),
        Row(
            name=f"{bad.name}_freeze_ms",
            what=f"{bad.what}: longest time without a whole frame, {against}",
            unit="ms",
            values=[each.freeze_ms for each in adaptive],
            references=[each.freeze_ms for each in fixed],
            bar=bad.longest_freeze,
        ),
        Row(
            name=f"{bad.name}_frame_kbit",
            what=f"{bad.what}: bits through the link for each whole frame, {against}",
            unit="kbit",
            values=[each.frame_kbit for each in adaptive],
            references=[each.frame_kbit for each in fixed],
            bar=None,
            better="higher",
        ),
    ]


def _watch_through(
    source: Camera, robot: product.Robot, profile: PreviewProfile, bad: _Link, seed: int
) -> Outcome:
    seen = watch_far(
        source, robot, bad.impairment, settle_s=SETTLE_S, watch_s=WATCH_S, profile=profile, seed=seed
    )
    window = seen.window
    found = Outcome(window.frames_per_s, seen.freeze_ms, seen.passed_kbit / max(1, len(window.glances)))
    log(
        f"{bad.name}, {profile.value}: {found.frames_per_s:.1f} fps ({seen.delivered_percent:.0f} % of the"
        f" camera's frames), freeze {found.freeze_ms:.0f} ms, {found.frame_kbit:.0f} kbit a frame; at the end"
        f" {seen.target_kbps} kbit/s {seen.bitrate_reason}"
    )
    return found
