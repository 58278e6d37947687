"""robotctl monitor: the window."""

from collections.abc import Callable

import typer

from common.errors import UserError
from console.cli.options import RobotOption, TargetOption, session_of
from console.client import Credentials


def monitor(context: typer.Context, target: TargetOption = None, robot: RobotOption = None) -> None:
    """Open a window: live video, status, faults, events, plots, preview controls.

    Keys: p preview on or off, 1-3 profile, F11 full screen, q quit.
    """
    run = _window()
    session = session_of(context, target, False, robot)
    run(session.target, session.credentials())


def _window() -> Callable[[str, Credentials], None]:
    try:
        from console.window.monitor_program import run_monitor  # noqa: PLC0415 - Qt is needed here only
    except ModuleNotFoundError as error:
        if not (error.name or "").startswith(("PySide6", "shiboken6")):
            raise
        raise UserError(
            "the window needs Qt for Python, which is not installed",
            "Type, in a clone of the project: scripts/install-console",
        ) from error
    except ImportError as error:
        raise UserError(
            f"Qt can't be loaded: {error}",
            "Type: sudo apt install libegl1 libgl1 libxkbcommon-x11-0 libxcb-cursor0 libdbus-1-3",
        ) from error
    return run_monitor
