"""robotctl robots status: all known robots in one table, asked side by side."""

import asyncio
import time
from dataclasses import dataclass
from typing import Any

from rich.table import Table
from rich.text import Text

from common.errors import ExitCode, UserError
from console.cli.error_report import error_as_json
from console.cli.tables import STYLES, grid
from console.client import AsyncGatewayClient, ClientOptions
from console.client.results import Freshness, SystemStatus
from console.presentation.formatting import UNKNOWN, bit_rate, quantity
from console.presentation.health import active_severities, health_style, health_summary
from console.presentation.json_form import json_form
from console.presentation.severity_style import PREVIEW_STYLES, SeverityStyle
from console.robots import Robot, RobotsFile, read_credentials


@dataclass(frozen=True, slots=True)
class RobotAnswer:
    """What one robot answered.

    Args:
        name: In the file of known robots.
        robot: Its entry.
        status: None without an answer.
        error: Why there is none.
        took_ms: Time of the answer, connecting included.
    """

    name: str
    robot: Robot
    status: SystemStatus | None
    error: UserError | None
    took_ms: int


def ask_all(known: RobotsFile, within_s: float) -> list[RobotAnswer]:
    """Returns the answer of each known robot, in the file's order, after `within_s` at the latest."""

    async def gather() -> list[RobotAnswer]:
        asked = (_ask(name, robot, within_s) for name, robot in known.robots.items())
        return await asyncio.gather(*asked)

    return asyncio.run(gather())


async def _ask(name: str, robot: Robot, within_s: float) -> RobotAnswer:
    begin_s = time.monotonic()
    status, error = None, None
    options = ClientOptions(answer_within_s=within_s)
    try:
        async with AsyncGatewayClient(robot.target, options, read_credentials(robot)) as client:
            status = await client.status()
    except UserError as found:
        error = found
    return RobotAnswer(name, robot, status, error, round((time.monotonic() - begin_s) * 1000))


def exit_code(answers: list[RobotAnswer]) -> ExitCode:
    """Returns DONE if all have answered, UNREACHABLE if one did not, FAILED if one refused."""
    codes = {each.error.exit_code for each in answers if each.error}
    if not codes:
        return ExitCode.DONE
    return ExitCode.UNREACHABLE if ExitCode.UNREACHABLE in codes else ExitCode.FAILED


def answers_json(answers: list[RobotAnswer]) -> dict[str, Any]:
    """Returns the JSON form."""
    return {
        "robots": [
            {
                "name": each.name,
                "target": each.robot.target,
                "took_ms": each.took_ms,
                "status": json_form(each.status) if each.status else None,
                "error": error_as_json(each.error) if each.error else None,
            }
            for each in answers
        ]
    }


def answers_table(answers: list[RobotAnswer]) -> Table:
    """Returns the table: health, charge, preview and answering time of each robot, or why there is none."""
    table = grid("nowrap", "nowrap", "nowrap", "right", "nowrap", "right", "fold")
    table.add_row("robot", "at", "health", "battery", "preview", "answer", "", style="dim")
    for each in answers:
        table.add_row(Text(each.name, style="bold"), Text(each.robot.target, style="dim"), *_cells(each))
    return table


def _cells(answer: RobotAnswer) -> tuple[Text, ...]:
    status, error = answer.status, answer.error
    if status is None:
        reason = Text(str(error), style=STYLES[SeverityStyle.BAD])
        return Text("NO ANSWER", style=STYLES[SeverityStyle.BAD]), *(Text(UNKNOWN),) * 3, reason
    health, preview, battery = status.health, status.preview, status.platform.power.lipo_battery
    charge = quantity(battery.charge_percent, "%", 0) if battery.freshness is Freshness.FRESH else UNKNOWN
    rate = f" {bit_rate(preview.measured.bitrate_kbps)}" if preview.measured.available else ""
    style = health_style(health.state, active_severities(status.faults))
    return (
        Text(health.state.value.upper(), style=STYLES[style]),
        Text(charge),
        Text(f"{preview.state.value.upper()}{rate}", style=STYLES[PREVIEW_STYLES[preview.state]]),
        Text(f"{answer.took_ms} ms", style="dim"),
        Text(health_summary(status)),
    )
