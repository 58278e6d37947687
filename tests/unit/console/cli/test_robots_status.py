"""`robotctl robots status` asks all known robots at once: one that is slow keeps none of the others back."""

import threading
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from rich.text import Text

from console.cli.fleet_status import RobotAnswer, answers_table, ask_all
from console.cli.tables import STYLES
from console.client.mapping.methods import GET_SYSTEM_STATUS
from console.presentation.severity_style import SeverityStyle
from console.robots import Robot, RobotsFile
from omniseer.gateway.v1.fault_pb2 import FAULT_SEVERITY_ERROR
from omniseer.gateway.v1.system_status_pb2 import SystemStatus as StatusMessage
from tests.support.gateway_double import GatewayDouble, healthy_status, serving

NAMES = ("one", "two", "three", "four", "five")
ALL_WITHIN_S = 10
"""Reached only where not all of them are asked; the deadline of the calls is beyond it."""


class WaitsForAll(GatewayDouble):
    """Answers once every robot has been asked, and fails the call if that does not come."""

    def __init__(self, all_asked: threading.Barrier) -> None:
        super().__init__()
        self._all_asked = all_asked

    def GetSystemStatus(self, request: Any, context: Any) -> Any:  # noqa: N802
        self._all_asked.wait(ALL_WITHIN_S)
        return super().GetSystemStatus(request, context)


def test_all_are_asked_before_the_first_one_answers() -> None:
    all_asked = threading.Barrier(len(NAMES))
    with ExitStack() as stack:
        robots = {}
        for name in NAMES:
            double = WaitsForAll(all_asked)
            double.status.gateway_name = name
            robots[name] = Robot(target=f"127.0.0.1:{stack.enter_context(serving(double))}")
        answers = ask_all(RobotsFile(Path("config.toml"), robots), within_s=60)
    assert [each.error for each in answers] == [None] * len(NAMES)
    assert [each.name for each in answers] == list(NAMES), "in the order of the file"
    assert [each.status.gateway_name if each.status else None for each in answers] == list(NAMES)


def test_health_is_not_green_beside_an_error_that_it_ignores() -> None:
    message = healthy_status()
    assert health_cell(message) == ("OK", STYLES[SeverityStyle.GOOD])
    message.faults.add(id="preview.failed", severity=FAULT_SEVERITY_ERROR, active=True)
    assert health_cell(message) == ("OK", STYLES[SeverityStyle.WARNING])


def health_cell(message: StatusMessage) -> tuple[str, str]:
    """Returns the text and the style of a robot's health in the table."""
    status = GET_SYSTEM_STATUS.decode(message.SerializeToString())
    table = answers_table([RobotAnswer("one", Robot(target="one:50051"), status, None, 1)])
    _, cell = table.columns[2].cells
    assert isinstance(cell, Text)
    return cell.plain, str(cell.style)
