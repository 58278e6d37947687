"""Driving at a glance, in words."""

from dataclasses import replace

import pytest

from console.client import DriveInhibit, DrivePhase, DriveState, StopLatch, Supervision
from console.client.results import Teleop, TeleopState
from console.presentation.drive_display import LATE_S, own_display, watched_display
from console.presentation.severity_style import SeverityStyle
from tests.support.snapshots import snapshot
from tests.unit.console.client.results.test_driving import LIMITS

STATE = DriveState(
    monotonic_ns=1,
    newest_sequence=1,
    phase=DrivePhase.DRIVING,
    inhibits=(),
    vx_mps=0.2,
    vy_mps=0.0,
    wz_rad_s=-0.4,
    command_age_ms=12,
    loop_age_ms=30,
    picture_age_ms=118,
    speed_limit_mps=0.3,
    stop=None,
    problems=(),
    turn_limit_rad_s=2.97,
)
STOP = StopLatch(stop_id=7, by="bert", reason="lunch", age_ms=10)


def own(
    state: DriveState, *, state_age_s: float = 0.02, ready: bool = False
) -> tuple[str, SeverityStyle, str]:
    shown = own_display(state, LIMITS, Supervision.PICTURE, state_age_s=state_age_s, ready=ready)
    return shown.phase, shown.style, shown.reason


def teleop(**changes: object) -> Teleop:
    status = replace(snapshot().status.teleop, state=TeleopState.ENABLED, enabled=True)
    return replace(status, **changes)  # type: ignore[arg-type]


def test_the_driver_sees_speeds_limits_and_ages() -> None:
    shown = own_display(STATE, LIMITS, Supervision.PICTURE, state_age_s=0.02, ready=False)
    assert (shown.driver, shown.phase, shown.reason) == ("You drive", "DRIVING", "")
    assert [(bar.label, bar.value, bar.top, bar.now) for bar in shown.bars] == [
        ("forward", 0.2, 0.35, 0.3),
        ("left", 0.0, 0.25, 0.25),
        ("turn", -0.4, 0.8, 0.8),
    ]
    assert shown.ages == "command 32 ms, picture 138 ms"


def test_both_ages_grow_while_nothing_comes_from_the_robot() -> None:
    shown = own_display(STATE, LIMITS, Supervision.PICTURE, state_age_s=1.5, ready=False)
    assert shown.ages == "command 1512 ms, picture 1618 ms"


def test_what_the_picture_or_the_line_of_sight_permits_is_less() -> None:
    slow = own_display(
        replace(STATE, speed_limit_mps=0.17, turn_limit_rad_s=0.6, picture_age_ms=580),
        LIMITS,
        Supervision.PICTURE,
        state_age_s=0,
        ready=False,
    )
    assert [bar.now for bar in slow.bars] == [0.17, 0.17, 0.6]
    by_eye = own_display(
        replace(STATE, speed_limit_mps=0.15, turn_limit_rad_s=0.4, picture_age_ms=None),
        replace(LIMITS, max_vy_mps=0.0),
        Supervision.LINE_OF_SIGHT,
        state_age_s=0,
        ready=False,
    )
    assert by_eye.driver == "You drive, by line of sight"
    assert [(bar.label, bar.now) for bar in by_eye.bars] == [("forward", 0.15), ("turn", 0.4)]
    assert "picture" not in by_eye.ages


@pytest.mark.parametrize(("speed_mps", "turn_rad_s"), [(0.0, 0.0), (0.17, 0.8)])
def test_an_earlier_robot_does_not_say_how_fast_it_may_turn(speed_mps: float, turn_rad_s: float) -> None:
    shown = own_display(
        replace(STATE, speed_limit_mps=speed_mps, turn_limit_rad_s=None),
        LIMITS,
        Supervision.PICTURE,
        state_age_s=0,
        ready=False,
    )
    assert [bar.now for bar in shown.bars] == [speed_mps, speed_mps, turn_rad_s]


@pytest.mark.parametrize(
    ("state", "ready", "style", "reason"),
    [
        (
            replace(STATE, phase=DrivePhase.INHIBITED, inhibits=(DriveInhibit.PICTURE_STALE,)),
            False,
            SeverityStyle.WARNING,
            "The picture is too old. Release, then hold again",
        ),
        (
            replace(STATE, phase=DrivePhase.STOPPED, stop=STOP),
            False,
            SeverityStyle.BAD,
            "It is stopped by bert: lunch (stop 7). Reset the stop to go on",
        ),
        (replace(STATE, phase=DrivePhase.ARMED), False, SeverityStyle.GOOD, ""),
        (
            replace(STATE, phase=DrivePhase.ARMED),
            True,
            SeverityStyle.GOOD,
            "Hold W A S D, or the gamepad's shoulder button",
        ),
    ],
)
def test_the_reason_comes_with_what_to_do(
    state: DriveState, ready: bool, style: SeverityStyle, reason: str
) -> None:
    assert own(state, ready=ready) == (state.phase.value.upper(), style, reason)


def test_a_silent_robot_is_said_to_be_silent() -> None:
    phase, style, reason = own(STATE, state_age_s=LATE_S + 0.2)
    assert (phase, style) == ("DRIVING", SeverityStyle.BAD)
    assert reason == "The robot has not answered for 0.6 s"


def test_others_see_who_drives_and_why_nothing_moves() -> None:
    assert watched_display(teleop(state=TeleopState.UNKNOWN)) is None
    shown = watched_display(teleop(holder="anna", phase=DrivePhase.DRIVING))
    assert shown
    assert (shown.driver, shown.phase, shown.bars) == ("anna drives", "DRIVING", ())
    stopped = watched_display(teleop(phase=DrivePhase.STOPPED, stop=STOP))
    assert stopped
    assert (stopped.driver, stopped.stop) == ("No driver", STOP)
    assert "bert: lunch" in stopped.reason
    inhibits = (DriveInhibit.ROBOT_STOP,)
    pressed = watched_display(teleop(phase=DrivePhase.AVAILABLE, inhibits=inhibits))
    assert pressed
    assert (pressed.driver, pressed.reason) == ("No driver", "The robot's own stop is active")


def test_an_earlier_gateway_has_no_phases() -> None:
    phases = [watched_display(teleop(enabled=enabled, phase=DrivePhase.UNKNOWN)) for enabled in (True, False)]
    assert [shown.phase for shown in phases if shown] == ["AVAILABLE", "DISABLED"]


def test_what_was_known_of_a_silent_robot_is_not_shown_as_true() -> None:
    shown = watched_display(teleop(holder="anna", phase=DrivePhase.DRIVING), known=False)
    assert shown
    assert "anna" not in shown.driver
    assert shown.phase == "UNKNOWN"
    assert "does not answer" in shown.reason
