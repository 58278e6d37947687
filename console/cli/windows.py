"""robotctl view and robotctl monitor: the robot's video, in a window or without one."""

import importlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Final

import typer

from common.errors import ExitCode, UserError
from console.cli.options import RobotOption, TargetOption
from console.cli.session import Session, print_json, session_of, with_session
from console.cli.stopping import until_stopped
from console.monitor.credential_refresh import LoadCredentials
from console.presentation.json_form import json_form
from console.receiver.delivery import DeliveryChoice
from console.receiver.recording import Recording
from console.robots.robots_file import Robot
from console.robots.roster import RobotChoice, Roster
from console.robots.search import NetworkSearch
from console.target import parse_target
from console.viewer.headless import watch_headless
from console.viewer.summary import ViewSummary

_INSTALL_GSTREAMER: Final = (
    "Type: sudo apt-get install gir1.2-gst-plugins-base-1.0 gstreamer1.0-plugins-good"
    " gstreamer1.0-plugins-bad gstreamer1.0-libav python3-gi"
)
_INSTALL_QT: Final = "Type, in a clone of the project: scripts/install-console"
_INSTALL_LIBRARIES: Final = (
    "Type: sudo apt install libegl1 libgl1 libxkbcommon-x11-0 libxcb-cursor0 libdbus-1-3"
)
_QT: Final = ("PySide6", "shiboken6")

RecordOption = Annotated[
    Path | None,
    typer.Option("--record", metavar="FILE", help="Record the encoded stream (MPEG-TS) to a new file."),
]
HeadlessOption = Annotated[
    bool, typer.Option("--headless", help="Receive the video without a window.", show_default=False)
]
FramesOption = Annotated[
    int | None,
    typer.Option("--frames", min=1, help="With --headless: end after so many frames.", show_default=False),
]
PatienceOption = Annotated[
    float,
    typer.Option(
        "--patience",
        min=0.5,
        max=3600,
        metavar="SECONDS",
        help="With --headless: give up after so long without a frame.",
    ),
]
DeliveryOption = Annotated[
    DeliveryChoice,
    typer.Option(
        "--delivery",
        help="direct: as packets arrive; srt: after the SRT latency; auto: direct where possible.",
    ),
]


@with_session
def view(
    session: Session,
    *,
    record: RecordOption = None,
    headless: HeadlessOption = False,
    frames: FramesOption = None,
    patience_s: PatienceOption = 15.0,
    delivery: DeliveryOption = DeliveryChoice.AUTO,
) -> None:
    """Show the live preview with detections overlaid. The robot provides all settings.

    Keys: p preview on or off, v next camera, o boxes, a age, f full screen, q quit.
    """
    if frames and not headless:
        raise UserError("--frames is for --headless", "Add --headless", exit_code=ExitCode.USAGE)
    address = parse_target(session.target)
    _require_gstreamer()
    if not headless:
        with requiring_qt("--headless works without"):
            from console.window.programs import run_view  # noqa: PLC0415 - Qt is needed here only
    # A login that can't be used is reported before a file is made.
    session.credentials()
    if headless:
        recording = Recording(record) if record else None
        summary = _view_headless(
            session, address, frames=frames, patience_s=patience_s, recording=recording, delivery=delivery
        )
    else:
        summary, recording = run_view(address, record, session.credentials, delivery)
    if session.as_json:
        print_json(session.out, json_form(summary))
    elif headless or recording:
        session.out.print(summary.line(), soft_wrap=True)
    if recording and recording.error:
        raise recording.error


def monitor(context: typer.Context, target: TargetOption = None, robot: RobotOption = None) -> None:
    """Open a window: live video, status, faults, driving, recordings, preview controls.

    Keys: F1 lists all; Space STOP, t drive, p preview on or off, 1-3 profile, F9 side panel, f picture only,
    q quit.
    """
    open_monitor(lambda: session_of(context, target, robot))


def open_monitor(session_of_robot: Callable[[], Session]) -> None:
    """Opens the window, until it is closed.

    Args:
        session_of_robot: Called once it is known that there can be a window.

    Raises:
        UserError: There can be none, or of `session_of_robot`.
    """
    with requiring_qt():
        from console.window.programs import run_monitor  # noqa: PLC0415 - Qt is needed here only
    session = session_of_robot()

    def login_of(choice: RobotChoice) -> LoadCredentials:
        name = choice.name if choice.known else None
        return replace(session, robot=Robot(target=choice.target), name=name).credentials

    run_monitor(session.target, session.credentials, Roster(search=NetworkSearch()), login_of)


def _view_headless(
    session: Session,
    address: str,
    *,
    frames: int | None,
    patience_s: float,
    recording: Recording | None,
    delivery: DeliveryChoice,
) -> ViewSummary:
    # The viewer looks at the event itself: nothing has to be cut off.
    with until_stopped(lambda: None) as stopped:
        return watch_headless(
            address,
            frames=frames,
            patience_s=patience_s,
            recording=recording,
            stop=stopped.event,
            load=session.credentials,
            delivery=delivery,
        )


def _require_gstreamer() -> None:
    try:
        importlib.import_module("common.gst")
    except UserError as error:
        raise UserError(f"video needs GStreamer: {error.what}", _INSTALL_GSTREAMER) from error


@contextmanager
def requiring_qt(alternative: str = "") -> Iterator[None]:
    """Turns a failed import of `console.window` into an error with a remedy.

    Args:
        alternative: How to do without a window; empty where there is no way.

    Raises:
        UserError: Qt is not installed, or a library of the system that it needs.
    """
    more = f"; {alternative}" if alternative else ""
    try:
        yield
    except ModuleNotFoundError as error:
        if not (error.name or "").startswith(_QT):
            raise
        raise UserError(
            f"the window needs Qt for Python, which is not installed{more}", _INSTALL_QT
        ) from error
    except ImportError as error:
        # The system's loader names no module, but the library that is missing.
        if not (error.name or str(error)).startswith((*_QT, "lib")):
            raise
        raise UserError(f"Qt can't be loaded: {error}{more}", _INSTALL_LIBRARIES) from error
