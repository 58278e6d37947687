"""How long after the capture of the last picture shown the base moves, when no other one comes.

The driver drives by the picture: what the project's own viewer shows is what counts. Camera, preview and
viewer are on one machine, so that capture times and what the base notes are of one clock.
"""

import asyncio
import time
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from bench.drive.ground import Ground
from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from console.client import AsyncGatewayClient, DriveSession
from tests.support.driven_robot import DrivenRobot, gateway_for, in_motion
from tests.support.driver_view import Viewer, by_picture, young_picture
from tests.support.running_preview import RunningPreview
from tests.support.stalling_camera import StallingCamera

ROUNDS: Final = FEWEST_ROUNDS
SPEED_MPS: Final = 0.2
PROMISED_MS: Final = 650
LONGER_S: Final = 1.0
"""Longer than any motion may last after a fault."""
_HOLD_EVERY_S: Final = 0.02


@dataclass(frozen=True, slots=True)
class Scene:
    """A robot with a camera, and who drives it by the picture."""

    camera: StallingCamera
    robot: DrivenRobot
    client: AsyncGatewayClient
    viewer: Viewer


async def _silence_camera(scene: Scene) -> None:
    scene.camera.stall()


async def _stop_preview(scene: Scene) -> None:
    await scene.client.disable_preview()


async def _freeze_viewer(scene: Scene) -> None:
    scene.viewer.frozen = True


FAULTS: Final[Mapping[str, tuple[str, Callable[[Scene], Awaitable[None]]]]] = {
    "camera": ("the camera falls silent", _silence_camera),
    "preview": ("the preview is stopped", _stop_preview),
    "screen": ("the driver's screen freezes", _freeze_viewer),
}
"""By the middle of their rows' names: for people, and what happens."""


def rows(ground: Ground, wanted: set[str]) -> list[Row]:
    return [
        Row(
            name=row,
            what=f"{what}: from the capture of the last picture shown until the base has zero",
            unit="ms",
            values=[stopped_ms(ground, name) for _ in range(ROUNDS)],
            bar=PROMISED_MS,
            judged="worst",
        )
        for name, (what, _) in FAULTS.items()
        if (row := f"drive.stop_{name}_ms") in wanted
    ]


def stopped_ms(ground: Ground, fault: str) -> float:
    """Returns how long the base moves after the capture of the last picture; with programs of its own."""
    what, happens = FAULTS[fault]
    with TemporaryDirectory(dir=ground.directory) as name, StallingCamera() as camera:
        settings = {"source": {"kind": "gst", "description": camera.description}}
        teleop = {"line_of_sight": False, "legacy_clients": False}
        with (
            RunningPreview(Path(name), settings) as preview,
            gateway_for(
                Path(name),
                ground.base,
                ground.drive,
                preview={"socket": str(preview.socket)},
                teleop=teleop,
            ) as robot,
        ):
            took_ms = asyncio.run(_stopped_s(camera, robot, happens)) * 1000
    log(f"{what}: {took_ms:.1f} ms after the last picture")
    return took_ms


async def _stopped_s(
    camera: StallingCamera, robot: DrivenRobot, happens: Callable[[Scene], Awaitable[None]]
) -> float:
    async with young_picture(robot) as (client, viewer), client.drive(by_picture(viewer)) as session:
        await in_motion(client, session, robot.base, SPEED_MPS)
        await asyncio.gather(happens(Scene(camera, robot, client, viewer)), _hold(session))
        return robot.base.stopped_after_s(viewer.shown_ns / 1e9)


async def _hold(session: DriveSession) -> None:
    """Holds on for a while, as a person who notices nothing."""
    until_s = time.monotonic() + LONGER_S
    while time.monotonic() < until_s:
        session.hold(SPEED_MPS)
        await asyncio.sleep(_HOLD_EVERY_S)
