"""The options every command has, before or after its name."""

from typing import Annotated, TypeAlias

import typer

from console.cli.session import Session, open_session
from console.client.target import DEFAULT_TARGET

TargetOption: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--target",
        metavar="HOST:PORT",
        help=f"The robot's gateway; {DEFAULT_TARGET} or $ROBOTCTL_TARGET when left out.",
        show_default=False,
    ),
]
JsonOption: TypeAlias = Annotated[
    bool, typer.Option("--json", help="Print JSON (docs/robotctl.md lists the keys).", show_default=False)
]


def remember(context: typer.Context, target: str | None, as_json: bool) -> None:
    """Keeps what stood before the command's name."""
    context.obj = (target, as_json)


def session_of(context: typer.Context, target: str | None, as_json: bool) -> Session:
    """The session: what stands after the command's name goes first."""
    target_before, json_before = context.obj
    return open_session(target or target_before, as_json or json_before)
