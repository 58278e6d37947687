"""Driving at a glance, for people: who drives, the phase, why nothing moves, speeds, ages. Pure."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from console.client import DrivePhase, DriveState, StopLatch, Supervision
from console.client.drive_reasons import rest_reasons
from console.client.results import DriveLimits, Teleop, TeleopState
from console.presentation.formatting import joined, sentence
from console.presentation.severity_style import DRIVE_STYLES, SeverityStyle
from console.steering import Speeds

LATE_S: Final = 0.4
"""Silence of the robot after which it stops its driver (LOOP_LATE, docs/driving.md)."""
_NEXT_STEPS: Final[Mapping[DrivePhase, str]] = {
    DrivePhase.ARMED: "Hold W A S D, or the gamepad's shoulder button",
    DrivePhase.INHIBITED: "Release, then hold again",
    DrivePhase.STOPPED: "Reset the stop to go on",
}
_MS_PER_S: Final = 1000


@dataclass(frozen=True, slots=True)
class SpeedBar:
    """One velocity against its limits, in m/s or rad/s.

    Args:
        label: forward, left, or turn: the positive direction.
        unit: of the figures.
        value: commanded to the base.
        top: what the robot accepts at the most; the bar's two ends.
        now: what supervision and picture permit at this moment.
    """

    label: str
    unit: str
    value: float
    top: float
    now: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveDisplay:
    """Driving at one moment, in words.

    Args:
        driver: who drives.
        phase: the phase in a word.
        style: of the phase.
        reason: why nothing moves, and what to do; empty while it moves.
        bars: the velocities; none while another one drives.
        ages: of command and picture; empty while another one drives.
        stop: the stop that is latched, and may be reset; None without one.
    """

    driver: str
    phase: str
    style: SeverityStyle
    reason: str
    bars: tuple[SpeedBar, ...] = ()
    ages: str = ""
    stop: StopLatch | None = None


def watched_display(teleop: Teleop, *, known: bool = True) -> DriveDisplay | None:
    """Returns driving as one sees it who does not drive; None on a robot that can't be driven.

    Args:
        teleop: of the newest status.
        known: whether that still holds; else the robot has not answered for a while.
    """
    if teleop.state is TeleopState.UNKNOWN:
        return None
    if not known:
        return DriveDisplay(
            driver="Driver not known",
            phase=DrivePhase.UNKNOWN.value.upper(),
            style=SeverityStyle.WARNING,
            reason="The robot does not answer. STOP may not reach it",
            stop=teleop.stop,
        )
    phase = teleop.phase
    if phase is DrivePhase.UNKNOWN:
        # A gateway of an earlier release has no phases.
        phase = DrivePhase.AVAILABLE if teleop.enabled else DrivePhase.DISABLED
    return DriveDisplay(
        driver=f"{teleop.holder} drives" if teleop.holder else "No driver",
        phase=phase.value.upper(),
        style=DRIVE_STYLES[phase],
        reason=sentence(rest_reasons(teleop.stop, teleop.inhibits)),
        stop=teleop.stop,
    )


def own_display(
    state: DriveState, limits: DriveLimits, supervision: Supervision, *, state_age_s: float, ready: bool
) -> DriveDisplay:
    """Returns driving as the driver sees it.

    Args:
        state: the robot's newest.
        limits: what the robot accepts.
        supervision: how the driver sees the robot.
        state_age_s: time since the state has arrived.
        ready: whether a hold would move the robot.
    """
    by = ", by line of sight" if supervision is Supervision.LINE_OF_SIGHT else ""
    late, state_age_ms = state_age_s > LATE_S, round(state_age_s * _MS_PER_S)
    reason = rest_reasons(state.stop, state.inhibits, state.problems)
    if late:
        reason = f"the robot has not answered for {state_age_s:.1f} s"
    step = _NEXT_STEPS.get(state.phase, "") if ready or state.phase is not DrivePhase.ARMED else ""
    return DriveDisplay(
        driver=f"You drive{by}",
        phase=state.phase.value.upper(),
        style=SeverityStyle.BAD if late else DRIVE_STYLES[state.phase],
        reason=". ".join(filter(None, (sentence(reason), step))),
        bars=tuple(_bars(state, limits, supervision)),
        # Both as of the state: they grow while no newer one comes.
        ages=joined(
            f"command {state.command_age_ms + state_age_ms} ms",
            "" if state.picture_age_ms is None else f"picture {state.picture_age_ms + state_age_ms} ms",
        ),
        stop=state.stop,
    )


def _bars(state: DriveState, limits: DriveLimits, supervision: Supervision) -> list[SpeedBar]:
    most = Speeds(*limits.permitted(supervision))
    now_mps = state.speed_limit_mps
    bars = [SpeedBar("forward", "m/s", state.vx_mps, limits.max_vx_mps, min(most.vx_mps, now_mps))]
    if limits.max_vy_mps:
        bars.append(SpeedBar("left", "m/s", state.vy_mps, limits.max_vy_mps, min(most.vy_mps, now_mps)))
    now_rad_s = state.turn_limit_rad_s
    if now_rad_s is None:
        # Not known of the picture; without a speed nothing turns, either.
        now_rad_s = most.wz_rad_s if now_mps else 0.0
    turn = SpeedBar("turn", "rad/s", state.wz_rad_s, limits.max_wz_rad_s, min(most.wz_rad_s, now_rad_s))
    return [*bars, turn]
