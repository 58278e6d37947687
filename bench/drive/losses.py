"""Driving over a link that loses packets, by all lanes and by one, in turns over the same link.

The age of the newest command is taken whenever the robot makes a state, on its clock, which is also that of
the driver's program here. A stop without need is another phase than driving while the driver holds.
"""

import statistics
import time
from dataclasses import dataclass
from typing import Final

from bench.drive.ground import Ground, driver, link
from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from console.client.drive_lanes import LANES

ROUNDS: Final = FEWEST_ROUNDS
ROUND_S: Final = 120.0
"""Of either number of lanes; ten minutes of each in all."""
LOSS: Final = 0.03
MUCH_LOSS: Final = 0.10
MINUTES: Final = ROUNDS * ROUND_S / 60


@dataclass(frozen=True, slots=True)
class Drive:
    """What one driver has seen.

    Attributes:
        stops: without need.
        p99_ms: age of the newest command, 99th percentile.
    """

    stops: int
    p99_ms: float


def rows(ground: Ground, wanted: set[str]) -> list[Row]:
    all_lanes: list[Drive] = []
    one: list[Drive] = []
    made = []
    if wanted - {"drive.false_stops_very_lossy"}:
        for seed in range(1, ROUNDS + 1):
            all_lanes.append(drive(ground, LOSS, LANES, ROUND_S, seed))
            one.append(drive(ground, LOSS, 1, ROUND_S, seed))
        made += _lossy_rows(all_lanes, one)
    if "drive.false_stops_very_lossy" in wanted:
        much = [drive(ground, MUCH_LOSS, LANES, ROUND_S, seed) for seed in range(1, ROUNDS + 1)]
        made.append(_very_lossy_row(much))
    return [row for row in made if row.name in wanted]


def drive(ground: Ground, loss: float, lanes: int, seconds: float, seed: int) -> Drive:
    """Drives for a while over a link that loses packets."""
    with (
        ground.robot() as robot,
        link(robot, loss, seed) as far,
        driver(far.target, "--lanes", str(lanes)) as hands,
    ):
        hands.ask("summary")
        time.sleep(seconds)
        seen = hands.ask("summary")
    ages_ms = seen["ages_ms"]
    found = Drive(seen["stops"], statistics.quantiles(ages_ms, n=100)[98])
    log(
        f"{loss:.0%} loss, {lanes} lanes, {seconds:.0f} s: {found.stops} stops without need, newest command"
        f" {statistics.median(ages_ms):.0f} ms old, 99 % {found.p99_ms:.0f}, worst {max(ages_ms):.0f}"
    )
    return found


def _lossy_rows(all_lanes: list[Drive], one: list[Drive]) -> list[Row]:
    link_text = f"{LOSS:.0%} loss both ways, round trip 20 ms"
    return [
        Row(
            name="drive.false_stops",
            what=f"{link_text}: stops without need in {ROUND_S:.0f} s",
            unit="",
            values=[each.stops for each in all_lanes],
            bar=0,
            judged="worst",
        ),
        Row(
            name="drive.false_stops_one_lane",
            what="the same by one lane",
            unit="",
            values=[each.stops for each in one],
            bar=None,
        ),
        Row(
            name="drive.command_p99_ms",
            what=f"{link_text}: age of the newest command at the robot, 99th percentile, against one lane",
            unit="ms",
            values=[each.p99_ms for each in all_lanes],
            references=[each.p99_ms for each in one],
            bar=0.6,
        ),
    ]


def _very_lossy_row(found: list[Drive]) -> Row:
    return Row(
        name="drive.false_stops_very_lossy",
        what=f"{MUCH_LOSS:.0%} loss both ways, round trip 20 ms: stops without need in {MINUTES:.0f} min",
        unit="",
        values=[each.stops for each in found],
        bar=1,
        judged="sum",
    )
