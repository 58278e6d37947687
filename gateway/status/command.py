"""The velocity command that the robot follows, and who gave it.

The robot's command mux lets one of its inputs through and doesn't say which. What it emits is attributed to
the input that spoke last, and only when that one just asked for the same; in every doubt to nobody.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from gateway.status.freshness import Sample, sample
from gateway.status.values import CommandSource, Received, Velocity

TOLERANCE: Final = 0.02
"""m/s and rad/s: a ramp changes that much between two messages, and both are not read at one instant."""
TOGETHER_S: Final = 0.25
"""An input that old when the mux emitted is not what it emitted."""


@dataclass(frozen=True, slots=True)
class Command:
    """What the robot is told to do; `source` is None when nobody can be named."""

    velocity: Velocity
    source: CommandSource | None


def effective_command(
    emitted: Received[Velocity] | None,
    inputs: Mapping[CommandSource, Received[Velocity]],
    stale_after_ms: int,
    now_s: float,
) -> Sample[Command]:
    """What the mux emitted last, and who asked for it.

    Args:
        emitted: the newest command out of the mux.
        inputs: the newest command of each of those who may command.
        stale_after_ms: how long a command counts.
        now_s: the moment to look at.
    """
    seen = sample(emitted, stale_after_ms, now_s)
    if emitted is None:
        return Sample(None, seen.freshness)
    source = _giver(emitted, inputs) if seen.freshness.fresh else None
    return Sample(Command(emitted.value, source), seen.freshness)


def _giver(
    emitted: Received[Velocity], inputs: Mapping[CommandSource, Received[Velocity]]
) -> CommandSource | None:
    if not inputs:
        return None
    source, newest = max(inputs.items(), key=lambda item: item[1].at_s)
    together = abs(emitted.at_s - newest.at_s) <= TOGETHER_S
    return source if together and _alike(emitted.value, newest.value) else None


def _alike(one: Velocity, other: Velocity) -> bool:
    return (
        abs(one.vx_mps - other.vx_mps) <= TOLERANCE
        and abs(one.vy_mps - other.vy_mps) <= TOLERANCE
        and abs(one.wz_rad_s - other.wz_rad_s) <= TOLERANCE
    )
