"""STOP in the window of a viewer, while another person drives."""

import asyncio
import threading
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from PySide6.QtCore import Qt

from console.client import AsyncGatewayClient, Credentials, DrivePhase, GatewayClient, GatewayError
from console.window.monitor_window import MonitorWindow
from console.window.programs import monitor
from gateway.access.role import Role
from tests.support.driven_robot import BY_EYE, driven_base, held, in_motion, moving
from tests.support.guarded_program import guarded_program
from tests.support.heard import Base
from tests.support.lost_worker import RESET_WITHIN_S
from tests.support.patient import PATIENT
from tests.support.qt import press, until
from tests.support.undisturbed import no_stall, undisturbed

pytestmark = pytest.mark.ros

SPEED_MPS = 0.1
MOVES_WITHIN_S = 60.0
"""Longer than `in_motion` takes at the most."""


@contextmanager
def held_by(target: str, login: Credentials, base: Base) -> Iterator[None]:
    """Another person drives, and notices nothing, while the block lasts; the base moves when it begins."""
    begun, ending = threading.Event(), threading.Event()

    async def drive() -> None:
        client = AsyncGatewayClient(target, PATIENT, login)
        async with client, client.drive(BY_EYE) as session:
            await in_motion(client, session, base, SPEED_MPS)
            async with held(session, SPEED_MPS):
                begun.set()
                await asyncio.to_thread(ending.wait)

    with ThreadPoolExecutor(1) as threads:
        driving = threads.submit(asyncio.run, drive())
        try:
            until(lambda: begun.is_set() or driving.done(), "the robot is driven", MOVES_WITHIN_S)
            if not begun.is_set():
                end(driving)
            yield
        finally:
            ending.set()
        end(driving)


def end(driving: "Future[None]") -> None:
    """Waits for its end, which has to be a good one."""
    try:
        driving.result(MOVES_WITHIN_S)
    except GatewayError as error:
        raise AssertionError("the other person can't drive") from error


def is_free(own: GatewayClient) -> bool:
    """Whether the robot can be driven; resets what an attempt before this one has left."""
    with suppress(GatewayError):
        teleop = own.status().teleop
        if teleop.stop:
            own.reset_stop(teleop.stop.stop_id)
        return teleop.phase is DrivePhase.AVAILABLE and not teleop.holder and not teleop.stop
    return False


@pytest.mark.timeout(300)
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

            def attempt() -> None:
                with robot.client() as own:
                    until(lambda: is_free(own), "the robot can be driven", RESET_WITHIN_S)
                with (
                    no_stall(),
                    monitor(robot.target, lambda: vic) as window,
                    held_by(robot.target, anna, base),
                    moving(base, drive),
                ):
                    vic_stops_it(window, base)

            undisturbed(attempt)


def vic_stops_it(window: MonitorWindow, base: Base) -> None:
    hud = window.picture.hud
    until(lambda: "anna drives. DRIVING" in hud.accessibleName(), "vic sees who drives")
    press(window, Qt.Key.Key_Space)
    until(lambda: not base.moves, "the base has zero")
    heard = len(base.heard)
    until(lambda: any("Stopped: " in note.text for note in window.toasts.notes), "vic is answered")
    until(lambda: "STOPPED. It is stopped by vic" in hud.accessibleName(), "and sees by whom")
    until(window.strip.driving.reset.isEnabled, "the stop has a number")
    # To stop takes the role of a viewer, to have the robot moved again that of an operator.
    window.driving.reset()
    until(lambda: any("Not reset: " in note.text for note in window.toasts.notes), "and no more")
    assert not any(each.moves for each in base.heard[heard:]), "anna still holds"
