"""robotctl preview on|off."""

from typing import Annotated, Literal

import typer

from common.errors import UserError
from console.cli.session import Session, print_json, with_session
from console.cli.tables import rows_table
from console.client import PreviewChange, PreviewProfile, PreviewState
from console.presentation.json_form import json_form
from console.presentation.status_table import preview_rows

preview_app = typer.Typer(
    help="Turn the live preview on or off.", add_completion=False, rich_markup_mode=None
)


ProfileOption = Annotated[
    Literal["low-bw", "balanced", "high-quality"] | None,
    typer.Option("--profile", help="Bandwidth profile.", show_default="the current one, or balanced"),
]
WaitOption = Annotated[
    float,
    typer.Option(
        "--wait",
        min=0,
        max=120,
        metavar="SECONDS",
        help="How long to wait for it; 0 ends with the robot's first answer.",
    ),
]


@preview_app.command("on")
@with_session
def preview_on(session: Session, *, profile: ProfileOption = None, wait_s: WaitOption = 10.0) -> None:
    """Turn the preview on, or change its profile while it runs.

    Exit code 0 when frames leave the robot, 1 when the preview can't start (with the robot's reason).
    """
    with session.connect() as gateway:
        change = gateway.enable_preview(PreviewProfile(profile or "unknown"), settle_within_s=wait_s)
    _finish(session, change, PreviewState.RUNNING, wait_s)


@preview_app.command("off")
@with_session
def preview_off(session: Session, wait_s: WaitOption = 10.0) -> None:
    """Turn the preview off. Exit code 0 when it is off, whether it was on or not."""
    with session.connect() as gateway:
        change = gateway.disable_preview(settle_within_s=wait_s)
    _finish(session, change, PreviewState.DISABLED, wait_s)


def _finish(session: Session, change: PreviewChange, requested: PreviewState, wait_s: float) -> None:
    error = _error(change, requested, wait_s)
    if session.as_json:
        print_json(session.out, {"ok": error is None, **json_form(change)})
    elif error is None:
        session.out.print(change.message)
        session.out.print(rows_table(preview_rows(change.preview)))
    if error:
        raise error


def _error(change: PreviewChange, requested: PreviewState, wait_s: float) -> UserError | None:
    state = change.preview.state
    if not change.accepted:
        return UserError(f"the robot refused: {change.message}")
    if state is requested:
        return None
    if state is PreviewState.FAULTED:
        return UserError(f"the preview is faulted: {change.preview.last_error or change.message}")
    if wait_s == 0:
        # The robot's first answer is all that was requested.
        return None
    return UserError(
        f"the preview is {state.value}, not {requested.value}, after {wait_s:g} s",
        "Type: robotctl status",
    )
