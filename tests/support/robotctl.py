"""robotctl as a user starts it: another process, its exit code and what it printed."""

import os
import subprocess
import sys
from pathlib import Path

ROBOTCTL = Path(sys.executable).parent / "robotctl"
ENDS_WITHIN_S = 60.0


def environment(**extra: str) -> dict[str, str]:
    """This one without settings and known robots that would change how robotctl behaves."""
    dropped = {"ROBOTCTL_TARGET", "ROBOTCTL_ROBOT", "NO_COLOR", "FORCE_COLOR", "COLUMNS", "LINES", "TERM"}
    kept = {name: value for name, value in os.environ.items() if name not in dropped}
    return kept | {"XDG_CONFIG_HOME": "/nonexistent"} | extra


def robotctl(*words: str, **extra: str) -> "subprocess.CompletedProcess[str]":
    """Runs it to its end, in pipes; `extra` goes into its environment."""
    return subprocess.run(
        [ROBOTCTL, *words],
        capture_output=True,
        text=True,
        timeout=ENDS_WITHIN_S,
        env=environment(**extra),
        check=False,
    )


def only_line(text: str) -> str:
    """The one line there is."""
    (line,) = text.splitlines()
    return line
