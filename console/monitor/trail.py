"""The way a robot has driven, from its measured velocities. Pure.

The status has velocities but no pose, so the way is dead reckoning from where the window was opened: good for
"where did I come from", not for navigation.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Final

from console.client.results import Freshness, Odometry

_LONGEST_STEP_S: Final = 2.5
"""Over a longer gap the velocity is unknown, and the way begins anew. A status without a change is repeated
every second."""
_SPACING_M: Final = 0.05
_KEPT: Final = 1000
"""Points that are kept: 50 m of way at least."""


@dataclass(frozen=True, slots=True)
class Pose:
    """A place, relative to the beginning of the way: x ahead and y left, as the robot stood there."""

    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0


class Trail:
    """Integrates velocities. Belongs to one thread."""

    def __init__(self) -> None:
        self._pose = Pose()
        self._points: deque[Pose] = deque([self._pose], _KEPT)
        self._at_s: float | None = None

    @property
    def pose(self) -> Pose:
        """Where the robot is now."""
        return self._pose

    @property
    def points(self) -> tuple[Pose, ...]:
        """The way, oldest first, and the robot's present place as its end."""
        return (*self._points, self._pose)

    @property
    def moved(self) -> bool:
        """Whether there is a way to show."""
        return len(self._points) > 1

    def add(self, odometry: Odometry, received_s: float) -> None:
        """Takes a measurement; one that is stale, or was taken already, adds nothing.

        Args:
            odometry: the measurement.
            received_s: when its status came, on the monotonic clock.
        """
        velocity = (odometry.vx_mps, odometry.vy_mps, odometry.wz_rad_s)
        if odometry.freshness is not Freshness.FRESH or not all(map(_is_finite, velocity)):
            return
        at_s = received_s - (odometry.age_ms or 0) / 1000
        before_s, self._at_s = self._at_s, max(at_s, self._at_s or at_s)
        if before_s is None or at_s <= before_s:
            return
        if at_s - before_s > _LONGEST_STEP_S:
            self._pose = Pose()
            self._points.clear()
            self._points.append(self._pose)
            return
        self._step(at_s - before_s, *velocity)  # type: ignore[arg-type]  # all are numbers

    def _step(self, seconds: float, vx_mps: float, vy_mps: float, wz_rad_s: float) -> None:
        turned = wz_rad_s * seconds
        # The heading in the middle of the step: exact for straight ways, of second order on a curve.
        heading = self._pose.heading_rad + turned / 2
        cosine, sine = math.cos(heading), math.sin(heading)
        self._pose = Pose(
            self._pose.x_m + (vx_mps * cosine - vy_mps * sine) * seconds,
            self._pose.y_m + (vx_mps * sine + vy_mps * cosine) * seconds,
            math.remainder(self._pose.heading_rad + turned, math.tau),
        )
        last = self._points[-1]
        if math.hypot(self._pose.x_m - last.x_m, self._pose.y_m - last.y_m) >= _SPACING_M:
            self._points.append(self._pose)


def _is_finite(value: float | None) -> bool:
    return value is not None and math.isfinite(value)
