"""Foreign programs: started with a bound on their time; what they say is shown only when they fail."""

import os
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from common.errors import UserError

_LINES: Final = 20
"""Of a failed program's output."""


def run(
    *command: str | Path,
    within_s: float,
    cwd: Path | None = None,
    environment: Mapping[str, str] | None = None,
    remedy: str = "",
) -> str:
    """Runs a program to its end and returns its standard output.

    Args:
        command: the program and its arguments.
        within_s: seconds until it is killed.
        cwd: its working directory.
        environment: variables besides this program's own.
        remedy: what to do if it fails.

    Raises:
        UserError: it is missing, failed, or took too long. The message has the end of its output.
    """
    name = Path(command[0]).name
    try:
        ended = subprocess.run(  # noqa: S603  # without a shell, words of this program's own
            [str(word) for word in command],
            cwd=cwd,
            # Without the path by which this program finds its own modules.
            env={**os.environ, **(environment or {}), "PYTHONPATH": ""},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=within_s,
            check=False,
        )
    except FileNotFoundError as error:
        raise UserError(f"{name} is not installed", remedy) from error
    except subprocess.TimeoutExpired as error:
        raise UserError(f"{name} did not end within {within_s:.0f} s", remedy) from error
    if ended.returncode:
        tail = " / ".join((ended.stdout + ended.stderr).strip().splitlines()[-_LINES:])
        raise UserError(f"{name} failed with code {ended.returncode}: {tail}", remedy)
    return ended.stdout
