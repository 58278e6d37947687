"""robotctl info: the gateway program itself."""

import json
import sys
from datetime import UTC
from typing import Annotated, Any, Final

import typer
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from console.cli.session import Session, with_session
from console.cli.tables import grid
from console.cli.typed_options import typed_options
from console.client import GatewayInfo
from console.presentation.formatting import UNKNOWN, age, wall_clock
from console.presentation.json_form import json_form

_FULL: Final = "robotctl info --full"


@with_session
def info(
    session: Session,
    *,
    full: Annotated[
        bool, typer.Option("--full", help="Show the configuration, too.", show_default=False)
    ] = False,
) -> None:
    """Show the gateway program: build, call counts, configuration."""
    with session.connect() as gateway:
        answer = gateway.info()
    session.show(info_json(answer), info_view(answer, gateway.target, full=full))


def info_json(info: GatewayInfo) -> dict[str, Any]:
    """Returns the JSON form, with the configuration as an object instead of a text."""
    document: dict[str, Any] = json_form(info)
    text = document.pop("configuration_json")
    return document | {"configuration": json.loads(text) if text else None}


def info_view(info: GatewayInfo, target: str, *, full: bool = False) -> RenderableType:
    """Returns the view for people: build and uptime, call counts; the full one with the configuration."""
    configuration = info.configuration_json or UNKNOWN
    typed = typed_options(sys.argv[1:])
    return Group(
        Text.assemble((info.gateway_name or "robot", "bold"), (f"  {target}", "dim")),
        Text(),
        _facts(info),
        Text(),
        _calls(info),
        Text(),
        Text("configuration" if full else f"configuration: {typed.repeated_in(_FULL)}", style="dim"),
        *([Text(configuration)] if full else []),
    )


def _facts(info: GatewayInfo) -> Table:
    table = grid("nowrap", "fold")
    for label, text in (
        ("version", info.gateway_version or UNKNOWN),
        ("revision", info.gateway.revision or UNKNOWN),
        ("up", age(info.gateway.uptime_ms)),
        ("boot", info.gateway.boot_id or UNKNOWN),
        ("its clock", wall_clock(info.wall_clock_unix_ms, UTC, "%Y-%m-%dT%H:%M:%S+00:00")),
    ):
        table.add_row(Text(label, style="dim"), Text(text))
    return table


def _calls(info: GatewayInfo) -> Table:
    table = grid("nowrap", "right", "right", "right")
    table.add_row("method", "served", "refused", "failed", style="dim")
    for counts in info.methods:
        table.add_row(Text(counts.method), str(counts.served), str(counts.refused), str(counts.failed))
    return table
