"""robotctl preview on|off."""

from typing import Annotated, Literal

import typer

from common.errors import UserError
from console.cli.session import Session, print_json, with_session
from console.cli.tables import rows_table
from console.client import CameraState, PreviewChange, PreviewProfile, PreviewState, PreviewStatus
from console.presentation.json_form import json_form
from console.presentation.status_table import preview_rows

preview_app = typer.Typer(
    help="Turn the live preview on or off.", add_completion=False, rich_markup_mode=None
)


ProfileOption = Annotated[
    Literal["low-bw", "balanced", "high-quality"] | None,
    typer.Option("--profile", help="Bandwidth profile.", show_default="the current one, or balanced"),
]
CameraOption = Annotated[
    str,
    typer.Option(
        "--camera",
        metavar="NAME",
        help="Camera to show; robotctl status lists them.",
        show_default="the current one, or the robot's first",
    ),
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
def preview_on(
    session: Session, *, profile: ProfileOption = None, camera: CameraOption = "", wait_s: WaitOption = 10.0
) -> None:
    """Turn the preview on, or change its profile or camera while it runs.

    Exit code 0 when frames (of that camera) leave the robot, 1 when they don't (with the robot's reason).
    """
    wanted = PreviewProfile(profile or "unknown")
    with session.connect() as gateway:
        change = gateway.enable_preview(wanted, camera=camera, settle_within_s=wait_s)
    _finish(session, change, PreviewState.RUNNING, wait_s, camera)


@preview_app.command("off")
@with_session
def preview_off(session: Session, wait_s: WaitOption = 10.0) -> None:
    """Turn the preview off. Exit code 0 when it is off, whether it was on or not."""
    with session.connect() as gateway:
        change = gateway.disable_preview(settle_within_s=wait_s)
    _finish(session, change, PreviewState.DISABLED, wait_s)


def _finish(
    session: Session, change: PreviewChange, requested: PreviewState, wait_s: float, camera: str = ""
) -> None:
    error = _error(change, requested, wait_s, camera)
    if session.as_json:
        print_json(session.out, {"ok": error is None, **json_form(change)})
    elif error is None:
        session.out.print(change.message)
        session.out.print(rows_table(preview_rows(change.preview)))
    if error:
        raise error


def _error(change: PreviewChange, requested: PreviewState, wait_s: float, camera: str) -> UserError | None:
    state = change.preview.state
    if not change.accepted:
        return UserError(f"the robot refused: {change.message}")
    if state is requested:
        return _camera_error(change.preview, camera, wait_s)
    if state is PreviewState.FAULTED:
        return UserError(f"the preview is faulted: {change.preview.last_error or change.message}")
    if wait_s == 0:
        # The robot's first answer is all that was requested.
        return None
    return UserError(
        f"the preview is {state.value}, not {requested.value}, after {wait_s:g} s",
        "Type: robotctl status",
    )


def _camera_error(preview: PreviewStatus, name: str, wait_s: float) -> UserError | None:
    """Returns why the requested camera is not shown; None if it is, or none was requested."""
    if not name:
        return None
    camera, live = preview.camera(name), preview.live_camera
    if camera is None:
        return UserError(
            f"this robot does not choose between cameras, and has not chosen '{name}'", "Update the robot"
        )
    if camera.state is CameraState.LIVE:
        return None
    instead = f"; camera {live.name} is shown" if live else ""
    if camera.state is CameraState.FAILED:
        return UserError(f"camera {name} does not work{instead}: {camera.error}")
    if wait_s == 0:
        return None
    return UserError(
        f"camera {name} is {camera.state.value} after {wait_s:g} s{instead}", "Type: robotctl status"
    )
