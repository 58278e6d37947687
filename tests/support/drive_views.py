"""Views of the drive program, for tests of what follows from them."""

from typing import Any

from gateway.status.teleop import (
    DriveActual,
    DriveCounters,
    DriveEpisode,
    DriveInhibit,
    DriveLimits,
    DrivePhase,
    DriveView,
    StopLatch,
    TeleopView,
)
from gateway.status.values import Received, Velocity

LIMITS = DriveLimits(
    max_vx_mps=0.40625,
    max_vy_mps=0.25,
    max_wz_rad_s=0.90625,
    acceleration_mps2=0.75,
    acceleration_rad_s2=1.75,
    max_picture_age_ms=600,
    picture_travel_m=0.125,
    line_of_sight_mps=0.1875,
    line_of_sight_rad_s=0.4375,
)


def actual(**more: Any) -> DriveActual:
    """A robot at rest that no one drives."""
    values: dict[str, Any] = {
        "instance_id": "a process",
        "monotonic_ns": 1,
        "applied_revision": 1,
        "phase": DrivePhase.AVAILABLE,
        "inhibits": (),
        "session_id": "",
        "velocity": Velocity(0.0, 0.0, 0.0),
        "speed_limit_mps": 0.0,
        "limits": LIMITS,
    }
    return DriveActual(**(values | more))


def stopped_view(now_s: float) -> TeleopView:
    """A robot that was stopped while it was driven, with everything that its status can have."""
    since_ns = int((now_s - 2.625) * 1e9)
    state = actual(
        phase=DrivePhase.STOPPED,
        stop=StopLatch(221, "who stopped", "a reason to stop", since_ns),
        counters=DriveCounters(commands=5, stops=1),
        episode=DriveEpisode(1, "a driver", since_ns - 10**9, since_ns, 0.5, 0.25, "stopped"),
        base_timeout_ms=1009,
    )
    return TeleopView(
        drive=DriveView(enabled=True, applied=True, error="", actual=state),
        inhibits=(DriveInhibit.BASE_ABSENT, DriveInhibit.DRIVE_LOST),
        holder="a driver",
        command=Received(Velocity(0.0625, -0.03125, 0.15625), now_s - 0.5078125),
        last_error="why a command was refused",
    )
