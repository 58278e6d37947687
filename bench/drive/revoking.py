"""How long the base moves after the credential of its driver was revoked, while the driver holds on."""

import asyncio
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from bench.drive.ground import Ground
from bench.progress import log
from bench.rows import FEWEST_ROUNDS, MeasurementError, Row
from console.client import AsyncGatewayClient, Credentials, NotAllowed
from console.robots.login import parse_login
from gateway.access.credential import Kind
from gateway.access.credential_admin import CredentialRequest
from gateway.access.role import Role
from tests.support.driven_robot import BY_EYE, in_motion, make_available
from tests.support.guarded_program import Guarded, guarded_program
from tests.support.heard import Base

ROUNDS: Final = FEWEST_ROUNDS
SPEED_MPS: Final = 0.1
HOLDS_S: Final = 2.0
"""Longer than any motion may last."""
_HOLD_EVERY_S: Final = 0.02


def rows(ground: Ground, _wanted: set[str]) -> list[Row]:
    return [
        Row(
            name="drive.stop_revoked_ms",
            what="the driver's credential is revoked: until the base has zero",
            unit="ms",
            values=[moved_ms(ground) for _ in range(ROUNDS)],
            bar=1100,
            judged="worst",
        )
    ]


def moved_ms(ground: Ground) -> float:
    """Returns how long the base moves after a revocation, in ms; each time with a gateway of its own."""
    teleop = {"socket": str(ground.drive.socket), "line_of_sight": True}
    with TemporaryDirectory(dir=ground.directory) as name:
        directory = Path(name)
        with guarded_program(directory, directory, teleop=teleop) as gateway:
            credential, bundle = gateway.admin.add(CredentialRequest("driver", Role.OPERATOR, Kind.TOKEN))
            driver = parse_login(bundle.text()).credentials
            took_ms = asyncio.run(_moved_s(gateway, ground.base, driver, credential.credential_id)) * 1000
    log(f"credential revoked: {took_ms:.1f} ms")
    return took_ms


async def _moved_s(gateway: Guarded, base: Base, driver: Credentials, credential_id: str) -> float:
    async with AsyncGatewayClient(gateway.target, credentials=gateway.own) as admin:
        await make_available(admin)
        async with (
            AsyncGatewayClient(gateway.target, credentials=driver) as client,
            client.drive(BY_EYE) as session,
        ):
            await in_motion(client, session, base, SPEED_MPS)
            began_s = time.monotonic()
            gateway.admin.revoke(credential_id)
            while time.monotonic() < began_s + HOLDS_S:
                session.hold(SPEED_MPS)
                await asyncio.sleep(_HOLD_EVERY_S)
            if not isinstance(session.error, NotAllowed):
                raise MeasurementError(f"the session did not end by the revocation: {session.error!r}")
            return base.stopped_after_s(began_s)
