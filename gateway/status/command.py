"""The velocity command that the robot follows, and the input of the command mux that it is attributed to.

A mux forwards one of its inputs without naming it. Its output is attributed to the input that was received
last, and only if that one requested the same velocity just before; in doubt it stays unattributed.
"""

from collections.abc import Mapping
from dataclasses import astuple, dataclass
from typing import Final

from gateway.status.freshness import Sample, sample
from gateway.status.values import CommandSource, Received, Velocity

TOLERANCE: Final = 0.02
"""m/s and rad/s: a ramp changes that much between two messages, and the two are not read at one instant."""
TOGETHER_S: Final = 0.25
"""Largest time between the mux's output and the input that it may have forwarded."""


@dataclass(frozen=True, slots=True)
class Command:
    """The effective command; `source` is None if it can't be attributed."""

    velocity: Velocity
    source: CommandSource | None


def effective_command(
    emitted: Received[Velocity] | None,
    inputs: Mapping[CommandSource, Received[Velocity]],
    stale_after_ms: int,
    now_s: float,
) -> Sample[Command]:
    """Returns the newest output of the mux and its source.

    Args:
        emitted: the newest command out of the mux.
        inputs: the newest command of each input.
        stale_after_ms: age from which a command no longer counts.
        now_s: the instant to look at.
    """
    seen = sample(emitted, stale_after_ms, now_s)
    if emitted is None:
        return Sample(None, seen.freshness)
    source = _source(emitted, inputs) if seen.freshness.fresh else None
    return Sample(Command(emitted.value, source), seen.freshness)


def _source(
    emitted: Received[Velocity], inputs: Mapping[CommandSource, Received[Velocity]]
) -> CommandSource | None:
    if not inputs:
        return None
    source, newest = max(inputs.items(), key=lambda item: item[1].at_s)
    together = abs(emitted.at_s - newest.at_s) <= TOGETHER_S
    return source if together and _alike(emitted.value, newest.value) else None


def _alike(one: Velocity, other: Velocity) -> bool:
    pairs = zip(astuple(one), astuple(other), strict=True)
    return all(abs(first - second) <= TOLERANCE for first, second in pairs)
