"""robotctl monitor: the window."""

import typer

from console.cli.options import RobotOption, TargetOption, session_of
from console.cli.qt import needing_qt


def monitor(context: typer.Context, target: TargetOption = None, robot: RobotOption = None) -> None:
    """Open a window: live video, status, faults, events, plots, preview controls.

    Keys: p preview on or off, 1-3 profile, F11 full screen, q quit.
    """
    with needing_qt():
        from console.window.programs import run_monitor  # noqa: PLC0415 - Qt is needed here only
    session = session_of(context, target, False, robot)
    run_monitor(session.target, session.credentials)
