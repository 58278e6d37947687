"""Runs the command line. Whatever goes wrong is one line on standard error and an exit code, no traceback."""

import os
import sys
from typing import NoReturn

import typer

from common.errors import ExitCode, UserError
from console.cli.app import app
from console.cli.session import report

_HELP = "Type: robotctl --help"


def run() -> NoReturn:
    """Ends the program."""
    sys.exit(exit_code())


def exit_code() -> int:
    """Runs the command line of this process; returns what the program is to end with."""
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
    except OSError as error:
        # A connection's troubles are GatewayErrors; what is left is the output: a full disk, for example.
        _forget_output()
        report(UserError(f"the output can't be written: {error.strerror or error}", "Look at where it goes"))
        return int(ExitCode.FAILED)
    except typer.Abort:
        return int(ExitCode.FAILED)
    return code if isinstance(code, int) else int(ExitCode.DONE)


def _forget_output() -> None:
    """What is still waiting to be written goes nowhere: Python would try again at the end, and complain."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)
