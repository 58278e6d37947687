"""A step of the calendar clock, as by NTP, neither stops the robot nor keeps it from stopping.

Fast DDS waits until instants of that clock. The step is in force in all programs of the robot.
"""

import asyncio
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from console.client import AsyncGatewayClient, DrivePhase
from tests.support.calendar_clock import CalendarClock
from tests.support.driven_robot import BY_EYE, DrivenRobot, available, driven_robot, held, in_motion
from tests.support.promise import keeps_async

pytestmark = [pytest.mark.ros, pytest.mark.timed, pytest.mark.alone]
SPEED_MPS = 0.1
HOUR_S = 3600
STEPS_S = (HOUR_S, 0, -HOUR_S)
DRIVEN_S = 2.0
RELEASED_S = 0.5


@pytest.fixture
def clock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> CalendarClock:
    clock = CalendarClock(tmp_path)
    for name, value in clock.environment.items():
        monkeypatch.setenv(name, value)
    return clock


@pytest.fixture
def robot(ros_domain: int, clock: CalendarClock, tmp_path: Path) -> Iterator[DrivenRobot]:  # noqa: ARG001
    with driven_robot(tmp_path) as robot:
        yield robot


async def test_a_step_of_an_hour_neither_stops_the_robot_nor_keeps_it_from_stopping(
    robot: DrivenRobot, clock: CalendarClock
) -> None:
    async def stops_without_need() -> float:
        clock.step(0)
        async with (
            available(robot),
            AsyncGatewayClient(robot.target) as client,
            client.drive(BY_EYE) as session,
        ):
            await in_motion(session, robot.base, SPEED_MPS)
            phases = set()
            async with held(session, SPEED_MPS):
                for step_s in STEPS_S:
                    clock.step(step_s)
                    until_s = time.monotonic() + DRIVEN_S
                    async for state in session.states():
                        phases.add(state.phase)
                        if time.monotonic() > until_s:
                            break
                    stamp_s = robot.base.heard[-1].stamp_s
                    assert stamp_s - time.time() == pytest.approx(step_s, abs=10), "the step is in force"
            released_s = time.monotonic()
            await asyncio.sleep(RELEASED_S)
            assert not robot.base.moves
            assert robot.base.stopped_after_s(released_s) < RELEASED_S
        return len(phases - {DrivePhase.DRIVING})

    await keeps_async(0, "phases beside driving while the calendar clock was stepped", stops_without_need)
