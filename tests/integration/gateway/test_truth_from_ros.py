"""From a robot's message bus to an operator's answer: commands and who gave them, components, the mode."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TwistStamped
from std_msgs.msg import String

from gateway.config import DEFAULT_SOURCES, SourceSettings
from omniseer.gateway.v1.fault_pb2 import FAULT_SEVERITY_ERROR, FAULT_SEVERITY_WARNING
from omniseer.gateway.v1.overlay_pb2 import OverlaySnapshot
from omniseer.gateway.v1.system_status_pb2 import SystemStatus
from tests.support.eventually import eventually
from tests.support.running_gateway import Operator, running_gateway
from tests.support.talker import Talker, talker

__all__ = ["talker"]

pytestmark = pytest.mark.ros
MODE = SourceSettings(kind="mode", topic="/mission/mode", type="std_msgs/msg/String", stale_after_ms=60_000)
SOURCES = (*(source for source in DEFAULT_SOURCES if not source.required), MODE)
KEYBOARD, NAVIGATION = "/cmd_vel_keyboard", "/cmd_vel_nav"
MUX = "/mecanum_drive_controller/reference"


@pytest.fixture
async def operator(ros_domain: int, tmp_path: Path) -> AsyncIterator[Operator]:  # noqa: ARG001  # for its effect
    faults = {"startup_grace_ms": 0, "clear_after_ms": 100}
    async with running_gateway(tmp_path / "p.sock", sources=SOURCES, faults=faults) as operator:
        yield operator


def command(vx: float, wz: float = 0.0) -> Any:
    message = TwistStamped()
    message.twist.linear.x, message.twist.angular.z = vx, wz
    return message


@asynccontextmanager
async def saying(talker: Talker, messages: dict[str, Any]) -> AsyncIterator[None]:
    """Publishes each message on its topic, fifty times a second, as long as the block lasts."""
    publishers = {topic: talker.publisher(topic, type(message)) for topic, message in messages.items()}

    async def talk() -> None:
        while True:
            for topic, message in messages.items():
                publishers[topic].publish(message)
            await asyncio.sleep(0.02)

    task = asyncio.create_task(talk())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def test_the_command_is_attributed_to_its_source(talker: Talker, operator: Operator) -> None:
    async with saying(talker, {KEYBOARD: command(0.5, 0.1), MUX: command(0.5, 0.1)}):
        status = await eventually(
            operator.status, lambda it: it.effective_command.active_source == "keyboard", "the keyboard"
        )
        seen = status.effective_command
        assert (seen.available, seen.stale) == (True, False)
        assert (seen.vx_mps, seen.wz_rad_s) == (pytest.approx(0.5), pytest.approx(0.1))
    async with saying(talker, {NAVIGATION: command(-0.3), MUX: command(-0.3)}):
        await eventually(
            operator.status, lambda it: it.effective_command.active_source == "navigation", "navigation"
        )


async def test_a_mux_that_obeys_another_source_is_attributed_to_none(
    talker: Talker, operator: Operator
) -> None:
    async with saying(talker, {KEYBOARD: command(0.5), MUX: command(0.0)}):
        status = await eventually(
            operator.status,
            lambda it: (
                {each.name for each in it.sources if each.available}
                >= {"mux_input.keyboard", "effective_command"}
            ),
            "both sides of the mux",
        )
        assert status.effective_command.active_source == "unknown"
    status = await eventually(operator.status, lambda it: it.effective_command.stale, "silence")
    assert status.effective_command.active_source == "unknown"
    assert not [fault for fault in status.faults if "command" in fault.id or "mux" in fault.id]


def report(name: str, level: Any, message: str) -> Any:
    return DiagnosticArray(status=[DiagnosticStatus(name=name, level=level, message=message)])


async def test_a_component_in_trouble_is_a_fault_until_it_says_it_is_well(
    talker: Talker, operator: Operator
) -> None:
    bad = report("/drive/motor_left", DiagnosticStatus.ERROR, "overcurrent")
    stale = report("lidar", DiagnosticStatus.STALE, "")

    def faults(status: Any) -> dict[str, Any]:
        return {each.id: each for each in status.faults if each.id.startswith("diagnostics.")}

    async with saying(talker, {"/diagnostics": bad}):
        await eventually(operator.status, lambda it: "diagnostics.drive_motor_left" in faults(it), "motor")
    async with saying(talker, {"/diagnostics": stale}):
        status = await eventually(operator.status, lambda it: "diagnostics.lidar" in faults(it), "lidar")
    motor, lidar = faults(status)["diagnostics.drive_motor_left"], faults(status)["diagnostics.lidar"]
    assert (motor.active, motor.severity) == (True, FAULT_SEVERITY_ERROR), "nothing said that it is well"
    assert motor.message == "drive motor_left: overcurrent"
    assert lidar.severity == FAULT_SEVERITY_WARNING
    async with saying(talker, {"/diagnostics": report("/drive/motor_left", DiagnosticStatus.OK, "fine")}):
        await eventually(
            operator.status,
            lambda it: not faults(it)["diagnostics.drive_motor_left"].active,
            "the end of the motor's fault",
        )


async def test_the_mode_arrives_and_its_change_is_an_event(talker: Talker, operator: Operator) -> None:
    def has_mode(mode: str, status: SystemStatus) -> bool:
        return status.mission.mode == mode

    def has_event_of(mode: str, overlay: OverlaySnapshot) -> bool:
        return f"robot mode: {mode}" in [event.message for event in overlay.events]

    for mode in ("idle", "exploring"):
        async with saying(talker, {MODE.topic: String(data=mode)}):
            await eventually(operator.status, partial(has_mode, mode), mode)
            await eventually(operator.overlay, partial(has_event_of, mode), f"the event of {mode}")
