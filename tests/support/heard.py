"""The velocities that a base has received, and so how long it moves after a fault. Pure."""

import math
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Heard:
    """A velocity that reached the subscriber.

    Attributes:
        at_s: when, by CLOCK_MONOTONIC.
        stamp_s: its stamp, by the publisher's calendar clock.
    """

    at_s: float
    stamp_s: float
    vx_mps: float
    vy_mps: float
    wz_rad_s: float

    @property
    def moves(self) -> bool:
        return (self.vx_mps, self.vy_mps, self.wz_rad_s) != (0.0, 0.0, 0.0)


@dataclass
class Base:
    """What takes the velocities, as a robot's base would."""

    heard: list[Heard] = field(default_factory=list)

    @property
    def moves(self) -> bool:
        """Whether the newest velocity is motion."""
        return bool(self.heard) and self.heard[-1].moves

    def stopped_after_s(self, since_s: float) -> float:
        """Returns how long after an instant zero has come that no motion followed.

        0 if it was at rest and nothing has come since; infinite if the last velocity that it had received
        then, or a later one, was motion, and no zero has followed. Silence is no stop: the base goes on.
        """
        received = [each for each in self.heard if each.at_s < since_s][-1:]
        received += [each for each in self.heard if each.at_s >= since_s]
        moved_s = max((each.at_s for each in received if each.moves), default=None)
        from_s = since_s if moved_s is None else max(moved_s, since_s)
        zeros_s = (each.at_s for each in received if not each.moves and each.at_s >= from_s)
        return next(zeros_s, since_s if moved_s is None else math.inf) - since_s
