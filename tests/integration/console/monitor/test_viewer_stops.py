"""STOP in the window of a viewer, while another person drives."""

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from PySide6.QtCore import Qt

from console.client import AsyncGatewayClient, Credentials
from console.window.programs import monitor
from gateway.access.role import Role
from tests.support.driven_robot import BY_EYE, driven_base, held, in_motion
from tests.support.guarded_program import guarded_program
from tests.support.heard import Base
from tests.support.qt import press, until

pytestmark = pytest.mark.ros

SPEED_MPS = 0.1
_ENDS_WITHIN_S = 10


@contextmanager
def held_by(target: str, login: Credentials, base: Base) -> Iterator[None]:
    """Another person drives, and notices nothing, while the block lasts; the base moves when it begins."""
    moving, ending = threading.Event(), threading.Event()

    async def drive() -> None:
        async with AsyncGatewayClient(target, credentials=login) as client, client.drive(BY_EYE) as session:
            await in_motion(client, session, base, SPEED_MPS)
            async with held(session, SPEED_MPS):
                moving.set()
                await asyncio.to_thread(ending.wait, _ENDS_WITHIN_S)

    thread = threading.Thread(target=asyncio.run, args=[drive()])
    thread.start()
    try:
        until(moving.is_set, "the robot is driven")
        yield
    finally:
        ending.set()
        thread.join(_ENDS_WITHIN_S)


def test_a_viewer_stops_a_robot_that_another_person_drives(
    ros_domain: int,  # noqa: ARG001  # for its effect
    tmp_path: Path,
) -> None:
    with driven_base(tmp_path) as (base, drive):
        teleop = {"socket": str(drive.socket), "line_of_sight": True}
        with guarded_program(tmp_path, tmp_path, teleop=teleop) as robot:
            anna, vic = (
                robot.added(name, role)[0] for name, role in (("anna", Role.OPERATOR), ("vic", Role.VIEWER))
            )
            with robot.client() as own:
                until(lambda: own.status().teleop.enabled, "driving is enabled")
            with monitor(robot.target, lambda: vic) as window, held_by(robot.target, anna, base):
                hud = window.picture.hud
                until(lambda: "anna drives. DRIVING" in hud.accessibleName(), "vic sees who drives")
                press(window, Qt.Key.Key_Space)
                until(lambda: not base.moves, "the base has zero")
                heard = len(base.heard)
                until(
                    lambda: any("Stopped: " in note.text for note in window.toasts.notes), "vic is answered"
                )
                until(lambda: "STOPPED. It is stopped by vic" in hud.accessibleName(), "and sees by whom")
                until(window.strip.driving.reset.isEnabled, "the stop has a number")
                # To stop takes the role of a viewer, to have the robot moved again that of an operator.
                window.driving.reset()
                until(lambda: any("Not reset: " in note.text for note in window.toasts.notes), "and no more")
                assert not any(each.moves for each in base.heard[heard:]), "anna still holds"
