"""The command line of robotctl. Commands raise their errors; console.cli.run reports them."""

from collections.abc import Callable, Mapping
from typing import Annotated, Any, Final, TypeVar

import typer
from rich.console import RenderableType

from common.errors import ExitCode
from common.findings import exit_code, print_findings
from common.version import project_version
from console.cli.events import events
from console.cli.info import info_json, info_view
from console.cli.json_form import json_form
from console.cli.login import login
from console.cli.options import GlobalOptions, JsonOption, RobotOption, TargetOption, with_session
from console.cli.preview import preview_app
from console.cli.robots import robots_app
from console.cli.session import Session
from console.cli.tables import overlay_view, status_view
from console.cli.watch import watch
from console.cli.windows import monitor, view
from console.client import GatewayClient, parse_target
from console.doctor.examination import examine, reached

AnswerT = TypeVar("AnswerT")

app = typer.Typer(
    name="robotctl",
    help="Show a robot's status and control its preview.",
    epilog="Exit codes: 0 done, 1 refused or failed, 2 wrong command line, 3 no robot answers.",
    pretty_exceptions_enable=False,
)
app.add_typer(preview_app, name="preview")
app.add_typer(robots_app, name="robots")


def _print_version(requested: bool) -> None:
    if requested:
        typer.echo(f"robotctl {project_version()}")
        raise typer.Exit


@app.callback()
def robotctl(
    context: typer.Context,
    target: TargetOption = None,
    robot: RobotOption = None,
    as_json: JsonOption = False,
    version: Annotated[  # noqa: ARG001  # its callback prints it
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version.")
    ] = False,
) -> None:
    """Show a robot's status and control its preview."""
    context.obj = GlobalOptions(target, robot, as_json)


def _query(
    call: Callable[[GatewayClient], AnswerT],
    document: Callable[[AnswerT], dict[str, Any]],
    view: Callable[[AnswerT, str], RenderableType],
    help_text: str,
) -> Callable[..., None]:
    """Returns the command that shows the answer of one call."""

    def query(session: Session) -> None:
        with session.connect() as gateway:
            answer = call(gateway)
        session.show(document(answer), view(answer, gateway.target))

    query.__doc__ = help_text
    return with_session(query)


@with_session
def doctor(session: Session) -> None:
    """Check name, network, login, gateway, clock and robot, and say what to do about each fault.

    Exit code 0 when nothing is wrong, 1 when something is, 3 when no gateway was reached.
    """
    findings = list(examine(parse_target(session.target), session.credentials()))
    print_findings(findings, as_json=session.as_json, out=session.out)
    code = exit_code(findings) if reached(findings) else ExitCode.UNREACHABLE
    raise typer.Exit(int(code))


COMMANDS: Final[Mapping[str, Callable[..., None]]] = {
    "status": _query(
        GatewayClient.status, json_form, status_view, "Show the status of the whole robot, once."
    ),
    "watch": watch,
    "overlay": _query(
        GatewayClient.overlay,
        json_form,
        overlay_view,
        "Show the robot's detections and the newest events, once.",
    ),
    "events": events,
    "info": _query(
        GatewayClient.info,
        info_json,
        info_view,
        "Show the gateway program: build, call counts, configuration.",
    ),
    "doctor": doctor,
    "login": login,
    "view": view,
    "monitor": monitor,
}
for name, function in COMMANDS.items():
    app.command(name)(function)
