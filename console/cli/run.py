"""Runs the command line. Whatever goes wrong is one line on standard error and an exit code, no traceback."""

import sys
from typing import NoReturn

import typer

from common.errors import ExitCode, UserError
from console.cli.app import app
from console.cli.session import report

_HELP = "Type: robotctl --help"


def run() -> NoReturn:
    """Ends the program."""
    sys.exit(_exit_code())


def _exit_code() -> int:
    try:
        code = app(prog_name="robotctl", standalone_mode=False)
    except UserError as error:
        report(error)
        return int(error.exit_code)
    except typer.TyperException as error:
        # A command line that can't be understood.
        usage = UserError(error.format_message().removesuffix("."), _HELP, exit_code=ExitCode.USAGE)
        report(usage)
        return int(usage.exit_code)
    except typer.Abort:
        return int(ExitCode.FAILED)
    return code if isinstance(code, int) else int(ExitCode.DONE)
