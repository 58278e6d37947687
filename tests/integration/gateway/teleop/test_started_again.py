"""What operators have requested outlives the gateway, also behind a stop."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from common.reasons import Reason
from console.client import AsyncGatewayClient, DrivePhase, GatewayError, Refused
from console.client.results import Teleop
from tests.support.driven_robot import BY_EYE, TELEOP
from tests.support.eventually import eventually
from tests.support.gateway_program import gateway_program
from tests.support.lost_worker import RESET_WITHIN_S
from tests.support.running_drive import RunningDrive, running_drive
from tests.support.undisturbed import same_worker, without_stall_async

# Timed: on a machine that is busy with other tests, a worker that is silent is replaced.
pytestmark = [pytest.mark.ros, pytest.mark.timed, pytest.mark.timeout(300)]


@contextmanager
def gateway(directory: Path, drive: RunningDrive) -> Iterator[str]:
    teleop = {"socket": str(drive.socket), **TELEOP}
    with gateway_program(directory, sources=[], teleop=teleop) as program:
        yield f"127.0.0.1:{program.port}"


async def teleop_of(client: AsyncGatewayClient) -> Teleop:
    return (await client.status()).teleop


@pytest.mark.usefixtures("module_ros_domain")
async def test_driving_that_was_disabled_stays_so_while_the_robot_is_stopped(tmp_path: Path) -> None:
    await without_stall_async(disabled_stopped_and_started_again, tmp_path)


async def disabled_stopped_and_started_again(directory: Path) -> None:
    with running_drive(directory) as drive, same_worker(drive):
        with gateway(directory, drive) as target:
            async with AsyncGatewayClient(target) as client:
                await eventually(lambda: teleop_of(client), lambda it: it.enabled, "driving is enabled")
                assert (await client.set_driving_enabled(False)).accepted
                stop_id = (await client.stop_robot("lunch")).stop.stop_id
        with gateway(directory, drive) as target:
            async with AsyncGatewayClient(target) as client:
                found = await eventually(lambda: teleop_of(client), lambda it: bool(it.stop), "the stop")
                assert (found.enabled, found.phase) == (False, DrivePhase.STOPPED)
                await eventually(lambda: is_reset(client, stop_id), bool, "it is reset", RESET_WITHIN_S)
                assert (await teleop_of(client)).phase is DrivePhase.DISABLED
                with pytest.raises(Refused) as refused:
                    async with client.drive(BY_EYE):
                        pass
                assert refused.value.reason == Reason.TELEOP_DISABLED


async def is_reset(client: AsyncGatewayClient, stop_id: int) -> bool:
    """Soon after its start the drive program does not know yet what else commands the robot."""
    try:
        await client.reset_stop(stop_id)
    except GatewayError:
        return (await teleop_of(client)).stop is None
    return True
