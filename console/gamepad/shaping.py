"""From a stick's deflection to a share of the permitted velocity. Pure."""

from typing import Final

DEAD_ZONE: Final = 0.12
"""Deflection that counts as none: worn sticks rest up to a tenth beside their middle."""
EXPO: Final = 0.5
"""Share of the cubic part: half the deflection beyond the dead zone is then 31 % of the velocity."""


def shaped(deflection: float, dead_zone: float = DEAD_ZONE, expo: float = EXPO) -> float:
    """Returns the share of the permitted velocity, from -1 to 1, and 0 up to the end of the dead zone.

    Args:
        deflection: from -1 to 1; beyond that as these.
        dead_zone: from 0 to below 1.
        expo: 0 is linear, 1 is cubic.
    """
    beyond = (min(abs(deflection), 1.0) - dead_zone) / (1.0 - dead_zone)
    if not beyond > 0:
        return 0.0
    share = (1.0 - expo) * beyond + expo * beyond**3
    return share if deflection > 0 else -share


def is_neutral(deflection: float, dead_zone: float = DEAD_ZONE) -> bool:
    """Returns whether a deflection counts as none."""
    return abs(deflection) <= dead_zone
