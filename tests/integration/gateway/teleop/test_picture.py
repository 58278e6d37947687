"""Driving by the picture, with real parts: preview, SRT, viewer, gateway, drive program.

The driver reports what the project's own viewer shows, and a subscriber behind the mux judges. All of it runs
on one machine, so that capture times and what the subscriber notes are of one clock.
"""

import asyncio
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import ExitStack, asynccontextmanager
from dataclasses import dataclass
from typing import Any

import pytest

from console.client import (
    AsyncGatewayClient,
    DriveInhibit,
    DriveOptions,
    DriveSession,
    PreviewProfile,
)
from tests.support.driven_robot import DrivenRobot, driven_robot, in_motion, is_at_rest
from tests.support.driver_view import Viewer, by_picture, young_picture
from tests.support.eventually import eventually
from tests.support.explained import explained_by
from tests.support.promise import MS, keeps_async
from tests.support.running_preview import RunningPreview
from tests.support.stalling_camera import StallingCamera
from tests.support.undisturbed import no_stall, undisturbed_async

# Timed: on a machine that is busy with other tests, late commands would end the motion.
pytestmark = [pytest.mark.ros, pytest.mark.gst, pytest.mark.timed]
SPEED_MPS = 0.2
FAST_MPS = 0.35
"""Faster than a base with mecanum wheels is: 0.264 m/s."""
PROMISED_MS = 650
"""From the capture of the last picture shown to zero, docs/driving.md."""
TRAVEL_M = 0.10
LATER_NS = 450_000_000
SLOWED_MPS = TRAVEL_M / 0.45
"""As if the picture had no other age."""
PATIENCE_S = 30.0
TICK_S = 0.02
HOLDS_S = 2.0
LONGER_S = 1.0
"""Longer than any motion may last after a fault."""


@dataclass
class Scene:
    """A robot with a camera."""

    camera: StallingCamera
    robot: DrivenRobot


@pytest.fixture(scope="module")
def scene(module_ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Scene]:  # noqa: ARG001
    directory = tmp_path_factory.mktemp("robot")
    with ExitStack() as stack:
        camera = stack.enter_context(StallingCamera())
        settings = {"source": {"kind": "gst", "description": camera.description}}
        preview = stack.enter_context(RunningPreview(directory, settings))
        teleop = {"line_of_sight": False, "legacy_clients": False}
        robot = stack.enter_context(
            driven_robot(
                directory,
                preview={"socket": str(preview.socket)},
                teleop=teleop,
                # A worker that a busy machine holds up is lost; that leaves no stop here.
                drive={"on_loss": "hand_back"},
            )
        )
        yield Scene(camera, robot)


@asynccontextmanager
async def seen(
    scene: Scene, profile: PreviewProfile = PreviewProfile.BALANCED
) -> AsyncIterator[tuple[AsyncGatewayClient, Viewer]]:
    """A client and a viewer that shows the robot's picture; no stop is latched."""
    scene.camera.go_on()
    with explained_by(scene.robot.drive.log):
        async with young_picture(scene.robot, profile) as client_and_viewer:
            yield client_and_viewer


async def held(
    session: DriveSession, for_s: float, speed_mps: float = SPEED_MPS, beside: asyncio.Task[Any] | None = None
) -> set[DriveInhibit]:
    """Holds for a time, and before that until a task is done; returns all reasons meanwhile."""
    reasons, until_s = set[DriveInhibit](), time.monotonic() + for_s
    while time.monotonic() < until_s:
        if beside and not beside.done():
            until_s = time.monotonic() + for_s
        session.hold(speed_mps)
        assert session.state
        reasons |= {*session.state.inhibits}
        await asyncio.sleep(TICK_S)
    return reasons


@pytest.mark.timeout(300)
@pytest.mark.parametrize("profile", [PreviewProfile.LOW_BW, PreviewProfile.BALANCED])
async def test_it_drives_by_what_the_viewer_shows(scene: Scene, profile: PreviewProfile) -> None:
    """No picture that the robot has sent is taken for one that it can't have sent."""

    async def attempt() -> None:
        # A stall of the machine makes every picture old.
        with no_stall():
            async with seen(scene, profile) as (client, viewer), client.drive(by_picture(viewer)) as session:
                await in_motion(client, session, scene.robot.base, SPEED_MPS)
                assert DriveInhibit.PICTURE_MISSING not in await held(session, HOLDS_S)
                assert session.state
                assert session.state.picture_age_ms is not None
                assert 0 < session.state.picture_age_ms < 600

    await undisturbed_async(attempt)


@pytest.mark.parametrize("fault", ["camera silent", "preview stopped", "viewer frozen"])
async def test_a_picture_without_a_successor_stops_the_robot_in_time(scene: Scene, fault: str) -> None:
    async def zero_after_ms() -> float:
        async with seen(scene) as (client, viewer), client.drive(by_picture(viewer)) as session:
            await in_motion(client, session, scene.robot.base, SPEED_MPS)
            stopping: asyncio.Task[Any] | None = None
            match fault:
                case "camera silent":
                    scene.camera.stall()
                case "preview stopped":
                    # Held meanwhile, however long it takes: a hold that lapses would stop the robot instead.
                    stopping = asyncio.create_task(client.disable_preview())
                case _:
                    viewer.frozen = True
            reasons = await held(session, LONGER_S, beside=stopping)
            if stopping:
                await stopping
            assert reasons & {DriveInhibit.PICTURE_MISSING, DriveInhibit.PICTURE_STALE}
            await eventually(lambda: is_at_rest(scene.robot.base), bool, "the last message is zero")
            return scene.robot.base.stopped_after_s(viewer.shown_ns / 1e9) * 1000

    await keeps_async(
        PROMISED_MS, f"{fault}, ms after the capture of the last picture", zero_after_ms, per_stalled_s=MS
    )


@pytest.mark.parametrize("camera", ["running", "silent"])
async def test_a_picture_that_the_robot_cant_have_sent_is_none(scene: Scene, camera: str) -> None:
    """One of the future; and any of now, while the camera is silent."""
    async with seen(scene) as (client, _):
        ahead_ns = 1_000_000_000 if camera == "running" else 0
        if camera == "silent":
            scene.camera.stall()
        async with client.drive(DriveOptions(picture=lambda: time.monotonic_ns() + ahead_ns)) as session:

            async def inhibits() -> tuple[DriveInhibit, ...]:
                session.hold(SPEED_MPS)
                return session.state.inhibits if session.state else ()

            missing = DriveInhibit.PICTURE_MISSING
            await eventually(inhibits, lambda it: missing in it, "refused", PATIENCE_S)
            assert not scene.robot.base.moves


async def test_the_age_of_the_picture_limits_the_speed(scene: Scene) -> None:
    """As fast as the limits permit with a fresh picture, and not with one that is LATER_NS older."""
    async with seen(scene) as (client, viewer):
        later_ns = 0

        def picture() -> int | None:
            newest_ns = viewer.video.meter.capture_ns()
            return newest_ns - later_ns if newest_ns else None

        async with client.drive(DriveOptions(picture=picture)) as session:
            await in_motion(client, session, scene.robot.base, FAST_MPS)
            assert await fastest_mps(scene, session) > SLOWED_MPS
            later_ns = LATER_NS
            # What was commanded by younger pictures has ended.
            await held(session, LONGER_S, FAST_MPS)
            slowed_mps = 0.0
            while (
                not slowed_mps
            ):  # In the end the test's own timeout: a picture that is older still stops it.
                await in_motion(client, session, scene.robot.base, FAST_MPS)
                slowed_mps = await fastest_mps(scene, session)
            assert slowed_mps <= SLOWED_MPS
            assert session.state
            assert session.state.picture_age_ms
            at_this_age_mps = TRAVEL_M / session.state.picture_age_ms * 1000
            assert session.state.speed_limit_mps == pytest.approx(at_this_age_mps, rel=0.25)


async def fastest_mps(scene: Scene, session: DriveSession) -> float:
    """The fastest motion while the driver holds for a while, straight ahead and as fast as possible."""
    began_s = time.monotonic()
    await held(session, HOLDS_S / 2, FAST_MPS)
    moving = [each for each in scene.robot.base.heard if each.at_s > began_s and each.moves]
    assert not any(each.vy_mps or each.wz_rad_s for each in moving)
    return max((each.vx_mps for each in moving), default=0.0)
