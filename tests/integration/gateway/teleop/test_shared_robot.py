"""What a stall, or a lost worker, does to stops that are measured: they are made anew."""

import asyncio
import time
from collections.abc import Iterator

import pytest

from console.client import AsyncGatewayClient, DriveSession
from tests.support import shared_robot as shared
from tests.support.driven_robot import driven_base
from tests.support.eventually import eventually
from tests.support.heard import Base
from tests.support.shared_robot import SharedRobot, Stopped, shared_robot

pytestmark = pytest.mark.ros
STOPS = 3
STALL_S = 2.5
"""Longer than the gateway waits for a driver, and a client for an answer."""

ENDS_WITHIN_S = 20.0


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


async def test_a_stop_that_a_lost_worker_has_spoilt_is_reset_and_made_anew(
    robot: SharedRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = shared._stop_in_motion
    spoilt: list[str] = []

    async def stop(
        viewer: AsyncGatewayClient, driver: AsyncGatewayClient, session: DriveSession, base: Base
    ) -> Stopped:
        if spoilt:
            return await made(viewer, driver, session, base)
        spoilt.append((await viewer.stop_robot()).stop.by)
        worker = robot.drive.worker
        worker.kill()
        await asyncio.to_thread(worker.wait, ENDS_WITHIN_S)
        raise AssertionError

    monkeypatch.setattr(shared, "_stop_in_motion", stop)
    (stopped,) = await robot.stops(1)
    assert spoilt == ["vic"], "latched by the viewer, not by the drive program"
    assert stopped.at_base_s >= 0
