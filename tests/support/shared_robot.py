"""A robot that one person drives and another, who may only look, stops: each by a login, over TLS."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from console.client import AsyncGatewayClient, Credentials, DriveSession, GatewayError
from gateway.access.credential import Kind
from gateway.access.credential_admin import CredentialRequest
from gateway.access.role import Role
from tests.support.driven_robot import BY_EYE, held, in_motion, make_available
from tests.support.eventually import eventually
from tests.support.guarded_program import guarded_program
from tests.support.heard import Base
from tests.support.lost_worker import ANY, RESET_WITHIN_S
from tests.support.running_drive import RunningDrive

SPEED_MPS: Final = 0.1
_ATTEMPTS: Final = 5
"""Of a stop that a lost worker has spoilt."""


@dataclass(frozen=True, slots=True)
class Stopped:
    """How a stop went, from the viewer's call on.

    Attributes:
        at_base_s: until the base had a zero that no motion followed.
        answered_s: until the viewer knew.
    """

    at_base_s: float
    answered_s: float


@dataclass(frozen=True, slots=True)
class SharedRobot:
    """Its parts.

    Attributes:
        target: of the gateway, which serves no one without a login.
        base: behind the drive program.
        drive: the drive program.
        driver: an operator's login.
        viewer: a viewer's login.
        crowd: the file of another viewer's login, for programs.
    """

    target: str
    base: Base
    drive: RunningDrive
    driver: Credentials
    viewer: Credentials
    crowd: Path

    async def stops(self, count: int, viewers_target: str = "") -> list[Stopped]:
        """Has the robot driven and stopped so many times.

        Args:
            count: how many.
            viewers_target: how the viewer reaches the gateway; by default as the driver does.

        Raises:
            AssertionError: a stop has failed, or a call, or the driver's session has ended: this process may
                have stood still for longer than either allows (tests.support.undisturbed).
        """
        operator = AsyncGatewayClient(self.target, credentials=self.driver)
        onlooker = AsyncGatewayClient(viewers_target or self.target, credentials=self.viewer)
        try:
            async with operator, onlooker:
                await make_available(operator)
                async with operator.drive(BY_EYE) as session:
                    return [await self._stop(onlooker, operator, session) for _ in range(count)]
        except (GatewayError, AssertionError) as error:
            raise AssertionError(f"a robot that is driven and stopped: {error}") from error

    async def _stop(
        self, viewer: AsyncGatewayClient, driver: AsyncGatewayClient, session: DriveSession
    ) -> Stopped:
        """Stops the robot in motion, once more where the drive program's worker was lost meanwhile."""
        for _ in range(_ATTEMPTS):
            worker = self.drive.worker
            try:
                return await _stop_in_motion(viewer, driver, session, self.base)
            except (GatewayError, AssertionError):
                if worker.is_running():
                    raise
        raise AssertionError(f"the worker of the drive program was lost in {_ATTEMPTS} stops, one by one")


@contextmanager
def shared_robot(
    directory: Path, base: Base, drive: RunningDrive, *, port: int = 0, also_at: str = ""
) -> Iterator[SharedRobot]:
    """Up when the block begins, with a gateway of its own before a drive program.

    Args:
        directory: for credentials, configuration and log.
        base: behind the drive program.
        drive: the drive program.
        port: of the gateway; 0 for any.
        also_at: another address of this machine at which the gateway is called; empty for loopback alone.
    """
    teleop: dict[str, Any] = {"socket": str(drive.socket), "line_of_sight": True}
    with guarded_program(directory, directory, port=port, also_at=also_at, teleop=teleop) as gateway:
        (driver, _), (viewer, _) = gateway.added("anna", Role.OPERATOR), gateway.added("vic", Role.VIEWER)
        crowd = directory / "crowd.login"
        _, bundle = gateway.admin.add(CredentialRequest("crowd", Role.VIEWER, Kind.TOKEN))
        crowd.write_text(bundle.text(), encoding="utf-8")
        yield SharedRobot(gateway.target, base, drive, driver, viewer, crowd)


async def _stop_in_motion(
    viewer: AsyncGatewayClient, driver: AsyncGatewayClient, session: DriveSession, base: Base
) -> Stopped:
    """Stops the robot while its driver holds; they release, and reset that."""
    # The stop of an attempt that a lost worker has spoilt may be latched, also by one of the two.
    await in_motion(driver, session, base, SPEED_MPS, resets=ANY)
    async with held(session, SPEED_MPS):
        began_s = time.monotonic()
        stopped = await viewer.stop_robot()
        answered_s = time.monotonic() - began_s
        await eventually(lambda: _rests(base), bool, "the base has zero")

    async def is_reset() -> bool:
        try:
            await driver.reset_stop(stopped.stop.stop_id)
        except GatewayError:  # The release is on its way, or it is reset already.
            return await is_gone()
        return True

    async def is_gone() -> bool:
        try:
            stop = (await driver.status()).teleop.stop
        except GatewayError:  # Late: the reset is tried again.
            return False
        return stop is None or stop.stop_id != stopped.stop.stop_id

    await eventually(is_reset, bool, "the stop is reset", RESET_WITHIN_S)
    return Stopped(base.stopped_after_s(began_s), answered_s)


async def _rests(base: Base) -> bool:
    return not base.moves
