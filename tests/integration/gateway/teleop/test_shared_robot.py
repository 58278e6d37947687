"""What a stall, or a lost worker, does to stops that are measured: they are made anew."""

import asyncio
import time
from collections.abc import Iterator

import pytest

from tests.support.driven_robot import driven_base
from tests.support.eventually import eventually
from tests.support.shared_robot import SharedRobot, shared_robot

pytestmark = pytest.mark.ros
STOPS = 3
STALL_S = 2.5
"""Longer than the gateway waits for a driver, and a client for an answer."""


@pytest.fixture(scope="module")
def robot(module_ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[SharedRobot]:  # noqa: ARG001
    directory = tmp_path_factory.mktemp("robot")
    with driven_base(directory) as (base, drive), shared_robot(directory, base, drive) as robot:
        yield robot


async def test_the_end_of_the_session_fails_as_what_a_stall_may_explain(robot: SharedRobot) -> None:
    async def moves() -> bool:
        return robot.base.moves

    async def stall() -> None:
        await eventually(moves, bool, "the base moves", 60.0)
        time.sleep(STALL_S)  # noqa: ASYNC251  # the stall

    stalling = asyncio.create_task(stall())
    with pytest.raises(AssertionError, match="driven and stopped"):
        await robot.stops(STOPS)
    await stalling
