"""A step of the calendar clock, as by NTP, neither stops the robot nor keeps it from stopping.

Fast DDS waits until instants of that clock. The step is in force in all programs of the robot.
"""

import asyncio
import os
import signal
import time
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from console.client import AsyncGatewayClient, DrivePhase
from tests.support.calendar_clock import CalendarClock
from tests.support.driven_robot import (
    BY_EYE,
    DrivenRobot,
    available,
    driven_robot,
    free,
    held,
    in_motion,
    moving,
)
from tests.support.driver_program import driver
from tests.support.promise import keeps_async

pytestmark = [pytest.mark.ros, pytest.mark.timed, pytest.mark.alone]
SPEED_MPS = 0.1
HOUR_S = 3600
STEPS_S = (HOUR_S, 0, -HOUR_S)
DRIVEN_S = 2.0
STEPPED_S = 0.2
"""From a step to what follows it."""
QUIET_S = 0.7
"""Longer than any motion may last after its end."""


@pytest.fixture(scope="module")
def clock(tmp_path_factory: pytest.TempPathFactory) -> Iterator[CalendarClock]:
    clock = CalendarClock(tmp_path_factory.mktemp("clock"))
    with pytest.MonkeyPatch.context() as environment:
        for name, value in clock.environment.items():
            environment.setenv(name, value)
        yield clock


@pytest.fixture(scope="module")
def robot(
    module_ros_domain: int,  # noqa: ARG001  # for its effect
    clock: CalendarClock,  # noqa: ARG001  # for its effect
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[DrivenRobot]:
    with driven_robot(tmp_path_factory.mktemp("robot")) as robot:
        yield robot


async def test_a_step_of_an_hour_does_not_stop_the_robot(robot: DrivenRobot, clock: CalendarClock) -> None:
    async def stops_without_need() -> float:
        clock.step(0)
        async with (
            available(robot),
            AsyncGatewayClient(robot.target) as client,
            client.drive(BY_EYE) as session,
        ):
            await in_motion(client, session, robot.base, SPEED_MPS)
            phases = set()
            async with held(session, SPEED_MPS):
                with moving(robot.base, robot.drive):
                    for step_s in STEPS_S:
                        clock.step(step_s)
                        until_s = time.monotonic() + DRIVEN_S
                        async for state in session.states():
                            phases.add(state.phase)
                            if time.monotonic() > until_s:
                                break
                        stamp_s = robot.base.heard[-1].stamp_s
                        assert stamp_s - time.time() == pytest.approx(step_s, abs=10), "the step is in force"
        return len(phases - {DrivePhase.DRIVING})

    await keeps_async(
        0,
        "phases beside driving while the calendar clock was stepped",
        stops_without_need,
        per_stalled_s=None,
    )


@pytest.mark.parametrize("step_s", [HOUR_S, -HOUR_S])
async def test_a_release_after_a_step_stops_within_60_ms(
    robot: DrivenRobot, clock: CalendarClock, step_s: int
) -> None:
    async def moved_s() -> float:
        clock.step(0)
        async with (
            available(robot),
            AsyncGatewayClient(robot.target) as client,
            client.drive(BY_EYE) as session,
        ):
            await in_motion(client, session, robot.base, SPEED_MPS)
            with ExitStack() as stack:
                async with held(session, SPEED_MPS):
                    clock.step(step_s)
                    await asyncio.sleep(STEPPED_S)
                    stack.enter_context(moving(robot.base, robot.drive))
                    released_s = time.monotonic()
                return await stopped_after_s(robot, released_s)

    await keeps_async(0.06, "s of motion after a release, after a step", moved_s)


@pytest.mark.parametrize("step_s", [HOUR_S, -HOUR_S])
async def test_a_client_that_is_frozen_after_a_step_stops_within_280_ms(
    robot: DrivenRobot, clock: CalendarClock, step_s: int
) -> None:
    async def moved_s() -> float:
        clock.step(0)
        await free(robot)
        with driver(robot.target) as process:
            clock.step(step_s)
            await asyncio.sleep(STEPPED_S)
            with moving(robot.base, robot.drive):
                frozen_s = time.monotonic()
                os.kill(process.pid, signal.SIGSTOP)
                return await stopped_after_s(robot, frozen_s)

    await keeps_async(0.28, "s of motion after the client was frozen, after a step", moved_s)


async def stopped_after_s(robot: DrivenRobot, since_s: float) -> float:
    """How long the base moved after an instant of the last moments."""
    await asyncio.sleep(QUIET_S)
    assert not robot.base.moves, "the last message is zero"
    return robot.base.stopped_after_s(since_s)
