"""Commands of tools without hold-to-run: one call, one motion of at most half a second, slowly."""

import time
from typing import Final

from common.errors import ConflictError
from gateway.links.drive.state import DriveCommand
from gateway.status.values import Velocity
from gateway.teleop.lane import Driving, is_finite
from gateway.teleop.lease import Demand, Driver
from gateway.teleop.stops import HOW_TO_REACH, in_words
from gateway.teleop.teleop import Teleop

_VALID_NS: Final = 500_000_000
_TOLERANCE: Final = 1e-6
"""Limits and velocities come from floats of different precision."""


class SingleCommands:
    """Carries SendTeleopCommand out.

    Args:
        teleop: gives the lease.
        permitted: whether the robot's owner permits such tools.
    """

    def __init__(self, teleop: Teleop, *, permitted: bool) -> None:
        self._teleop = teleop
        self._permitted = permitted

    def command(self, driver: Driver, velocity: Velocity) -> tuple[bool, str]:
        """Passes a single command of an older tool on; returns whether it was, and why not, for people."""
        error = self._refusal(velocity)
        if not error:
            try:
                driving = self._teleop.acquire(driver, Demand.UNARY, line_of_sight=True)
            except ConflictError as refusal:
                error = str(refusal)
            else:
                self._command_once(driving, velocity)
        self._teleop.last_error = error
        if error:
            return False, error
        stop = self._teleop.link.view.stop
        if stop:
            return True, in_words(stop)
        reasons = "; ".join(each.value for each in self._teleop.view().inhibits)
        return True, f"the robot does not move: {reasons}" if reasons else "passed on"

    def _refusal(self, velocity: Velocity) -> str:
        """Returns why a single command is refused; empty if nothing is against it."""
        view, limits = self._teleop.link.view, self._teleop.limits
        if not view.enabled:
            return "driving is disabled; enable it first"
        if limits is None or not view.reachable or not view.applied:
            return f"the robot's drive program does not answer: {HOW_TO_REACH}"
        if not self._permitted:
            return (
                "this robot does not permit commands without hold-to-run: use robotctl drive, or set "
                "teleop.legacy_clients in the gateway's configuration"
            )
        if not is_finite(velocity):
            return "a velocity is not finite"
        checked = (
            ("linear_x_mps", velocity.vx_mps, limits.max_vx_mps),
            ("linear_y_mps", velocity.vy_mps, limits.max_vy_mps),
            ("angular_z_rad_s", velocity.wz_rad_s, limits.max_wz_rad_s),
        )
        beyond = (f"|{name}| > {most:g}" for name, value, most in checked if abs(value) > most + _TOLERANCE)
        return "; ".join(beyond)

    def _command_once(self, driving: Driving, velocity: Velocity) -> None:
        held = (velocity.vx_mps, velocity.vy_mps, velocity.wz_rad_s) != (0.0, 0.0, 0.0)
        valid_until_ns = time.monotonic_ns() + _VALID_NS
        sequence = driving.session.sequence + 1
        self._teleop.take(
            driving, DriveCommand(sequence, held, velocity, valid_until_ns), "a tool without hold-to-run"
        )
