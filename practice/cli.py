"""robotctl practice: the cockpit without a robot."""

import typer

from common.errors import ExitCode, UserError
from console.cli.options import GlobalOptions  # noqa: TC001  # read by the type checker alone
from console.cli.windows import requiring_qt


def practice(context: typer.Context) -> None:
    """Practise driving in the monitor's window, without a robot: nothing leaves this computer.

    Keys: T drive, and end driving; W A S D or the arrows; Space STOP; Shift+R resets it; N another network;
    F1 lists all.
    """
    before: GlobalOptions = context.obj
    if before.target or before.robot:
        raise UserError(
            "practice reaches no robot", "Leave --target and --robot out", exit_code=ExitCode.USAGE
        )
    with requiring_qt():
        from practice.window import run_practice  # noqa: PLC0415 - Qt is needed here only
    run_practice()
