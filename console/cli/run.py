"""Runs the command line. Every error is one line on standard error and an exit code, never a traceback."""

import os
import sys
from typing import NoReturn

import typer

from common.command_line import usage_error
from common.errors import ExitCode, UserError
from common.output import tolerate_encoding
from console.cli.app import command_line
from console.cli.error_report import report
from console.cli.typed_options import typed_options


def run() -> NoReturn:
    """Runs the command line of this process and ends it."""
    tolerate_encoding()
    sys.exit(exit_code())


def exit_code() -> int:
    """Runs the command line of this process and returns its exit code."""
    try:
        code = command_line()(prog_name="robotctl", standalone_mode=False)
    except UserError as error:
        return _failed(error)
    except typer.TyperException as error:
        return _failed(usage_error(error, "robotctl", typed_options(sys.argv[1:]).words))
    except OSError as error:
        # Connections raise GatewayErrors, so this is the output: a full disk, for example.
        _discard_output()
        reason = error.strerror or error
        return _failed(UserError(f"the output can't be written: {reason}", "Check where it goes"))
    except typer.Abort:
        return int(ExitCode.FAILED)
    return code if isinstance(code, int) else int(ExitCode.DONE)


def _failed(error: UserError) -> int:
    report(error)
    return int(error.exit_code)


def _discard_output() -> None:
    """Sends buffered output to the null device: Python would write it again at exit, and fail again."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)
