"""robotctl view: the robot's video, in a window or without one."""

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Final

import typer

from common.errors import ExitCode, UserError
from console.cli.json_form import json_form
from console.cli.options import JsonOption, RobotOption, TargetOption, session_of
from console.cli.qt import needing_qt
from console.cli.stopping import until_stopped
from console.client import parse_target
from console.monitor.credential_refresh import LoadCredentials
from console.receiver.recording import Recording
from console.viewer.headless import watch_headless
from console.viewer.summary import ViewSummary

_GSTREAMER: Final = (
    "Type: sudo apt-get install gir1.2-gst-plugins-base-1.0 gstreamer1.0-plugins-good"
    " gstreamer1.0-plugins-bad gstreamer1.0-libav python3-gi"
)

RecordOption = Annotated[
    Path | None,
    typer.Option("--record", metavar="FILE", help="Keep the encoded stream (MPEG-TS) in a new file."),
]
HeadlessOption = Annotated[bool, typer.Option("--headless", help="Without a window.", show_default=False)]
FramesOption = Annotated[
    int | None,
    typer.Option("--frames", min=1, help="With --headless: end after so many pictures.", show_default=False),
]
PatienceOption = Annotated[
    float,
    typer.Option(
        "--patience",
        min=0.5,
        max=3600,
        metavar="SECONDS",
        help="With --headless: give up after so long without a picture.",
    ),
]


def view(
    context: typer.Context,
    *,
    record: RecordOption = None,
    headless: HeadlessOption = False,
    frames: FramesOption = None,
    patience_s: PatienceOption = 15.0,
    target: TargetOption = None,
    robot: RobotOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show the live preview with what the robot detects. Everything needed comes from the robot.

    Keys: p preview on or off, o boxes, f full screen, q quit.
    """
    session = session_of(context, target, as_json, robot)
    if frames and not headless:
        raise UserError("--frames is for --headless", "Add --headless", exit_code=ExitCode.USAGE)
    address = parse_target(session.target)
    _need_gstreamer()
    show = None if headless else _window()
    # Whatever is wrong with the login is said before a file is made.
    session.credentials()
    recording = Recording(record) if record else None
    if show:
        account = show(address, recording, session.credentials)
    else:
        with until_stopped(_nothing) as stopped:
            account = watch_headless(
                address,
                frames=frames,
                patience_s=patience_s,
                recording=recording,
                stop=stopped.event,
                load=session.credentials,
            )
    if session.as_json:
        session.print_json(json_form(account))
    elif headless or recording:
        session.out.print(account.line(), soft_wrap=True)
    if recording and recording.error:
        raise recording.error


def _nothing() -> None:
    """The watching looks for itself whether it shall end."""


def _need_gstreamer() -> None:
    try:
        importlib.import_module("common.gst")
    except UserError as error:
        raise UserError(f"video needs GStreamer: {error.what}", _GSTREAMER) from error


def _window() -> Callable[[str, Recording | None, LoadCredentials], ViewSummary]:
    with needing_qt("--headless works without"):
        from console.window.programs import run_view  # noqa: PLC0415 - Qt is needed here only
    return run_view
