"""What a robot's configuration permits: driving by eye, tools without hold-to-run, and how fast these are."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from common.reasons import Reason
from console.client import AsyncGatewayClient, DriveOptions, Refused
from tests.support.driven_robot import (
    BY_EYE,
    DrivenRobot,
    anew_after_a_loss,
    available,
    driven_base,
    free,
    gateway_for,
    is_at_rest,
    may_be_driven,
)
from tests.support.eventually import eventually
from tests.support.heard import Base, Heard
from tests.support.running_drive import RunningDrive
from tests.support.undisturbed import no_stall

# Timed: on a machine that is busy with other tests, a worker that is silent is replaced.
pytestmark = [pytest.mark.ros, pytest.mark.timed]
SLOW_MPS = 0.08
SLOW_RAD_S = 0.2
"""Without a picture, half of the defaults."""
LIMITS = {
    "vx_mps": 0.25,
    "vy_mps": 0.2,
    "wz_rad_s": 0.6,
    "line_of_sight_mps": SLOW_MPS,
    "line_of_sight_rad_s": SLOW_RAD_S,
}
COMMAND_S = 0.3
"""What a command without hold-to-run moves; 0.5 s by default."""
ROUNDING = 1e-6
READY_WITHIN_S = 20.0


@pytest.fixture(scope="module")
def driven(
    module_ros_domain: int,  # noqa: ARG001  # for its effect
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[tuple[Base, RunningDrive]]:
    deadlines = {"unary_ms": int(COMMAND_S * 1000)}
    with driven_base(tmp_path_factory.mktemp("robot"), limits=LIMITS, deadlines=deadlines) as parts:
        yield parts


@pytest.fixture
def robot(
    request: pytest.FixtureRequest, driven: tuple[Base, RunningDrive], tmp_path: Path
) -> Iterator[DrivenRobot]:
    """With the settings of the gateway that a test names by `permits`."""
    with gateway_for(tmp_path, *driven, teleop=request.param) as robot:
        yield robot


def permits(**teleop: bool) -> pytest.MarkDecorator:
    """Marks a test of a robot with these settings."""
    return pytest.mark.parametrize(
        "robot", [teleop], ids=[f"{name}={on}" for name, on in teleop.items()], indirect=True
    )


@permits(line_of_sight=False)
@anew_after_a_loss
async def test_no_one_drives_by_eye_where_that_is_not_permitted(robot: DrivenRobot) -> None:
    async with available(robot) as client:
        with pytest.raises(Refused, match=r"teleop\.line_of_sight") as refused:
            async with client.drive(BY_EYE):
                pass
        assert refused.value.reason == Reason.SUPERVISION_NOT_PERMITTED
        assert not (await client.status()).teleop.holder
        async with client.drive(DriveOptions(picture=time.monotonic_ns)) as session:
            assert session.limits is not None
            assert not session.limits.line_of_sight, "the driver's program learns that it need not try"


@permits(line_of_sight=True)
@anew_after_a_loss
async def test_by_eye_it_is_driven_where_that_is_permitted(robot: DrivenRobot) -> None:
    async with available(robot) as client, client.drive(BY_EYE) as session:
        assert session.limits is not None
        assert session.limits.line_of_sight
        assert session.limits.line_of_sight_mps == pytest.approx(SLOW_MPS)
        assert session.limits.line_of_sight_rad_s == pytest.approx(SLOW_RAD_S)
        state = await session.ready(READY_WITHIN_S)
        assert state.speed_limit_mps == pytest.approx(SLOW_MPS)
        assert state.turn_limit_rad_s == pytest.approx(SLOW_RAD_S)


@permits(legacy_clients=False)
@anew_after_a_loss
async def test_commands_without_hold_to_run_move_nothing_where_they_are_not_permitted(
    robot: DrivenRobot,
) -> None:
    async with AsyncGatewayClient(robot.target) as client:
        await may_be_driven(client)
        await free(robot)
        heard = len(robot.base.heard)
        answer = await client.send_velocity(SLOW_MPS)
        assert not answer.accepted
        assert "teleop.legacy_clients" in answer.message
        teleop = (await client.status()).teleop
        assert (teleop.holder, teleop.last_error) == ("", answer.message)
        assert await is_at_rest(robot.base)
        assert not any(each.moves for each in robot.base.heard[heard:])


@permits(legacy_clients=True)
@anew_after_a_loss
async def test_commands_without_hold_to_run_keep_to_the_configured_caps(robot: DrivenRobot) -> None:
    async with AsyncGatewayClient(robot.target) as client:
        await may_be_driven(client)
        await free(robot)
        for beyond in ((0.26, 0.0, 0.0), (0.0, -0.21, 0.0), (0.0, 0.0, 0.61)):
            assert not (await client.send_velocity(*beyond)).accepted
        with no_stall():
            straight = await motion_by(robot, client, 0.25, 0.0, 0.0)
            assert max(each.vx_mps for each in straight) == pytest.approx(SLOW_MPS, abs=ROUNDING)
            turning = await motion_by(robot, client, 0.0, 0.0, -0.6)
            assert min(each.wz_rad_s for each in turning) == pytest.approx(-SLOW_RAD_S, abs=ROUNDING)
            for motion in (straight, turning):
                assert motion[-1].stamp_s - motion[0].stamp_s <= COMMAND_S


async def motion_by(robot: DrivenRobot, client: AsyncGatewayClient, *velocity: float) -> list[Heard]:
    """Sends a single command; returns the motion that it makes, to its end."""
    before = len(robot.base.heard)
    answer = await client.send_velocity(*velocity)
    assert answer.accepted, answer.message

    async def motion() -> list[Heard]:
        return [each for each in robot.base.heard[before:] if each.moves]

    await eventually(motion, bool, "it moves")
    await eventually(lambda: is_at_rest(robot.base), bool, "it has stopped by itself")
    return await motion()
