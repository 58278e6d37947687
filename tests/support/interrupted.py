"""Runs a command until it has written something, then interrupts it like Ctrl-C: `interrupted.py COMMAND...`.

What it writes is its standard output or, if it has the option --record FILE, that file. Its exit code is this
program's.
"""

import signal
import subprocess
import sys
import time
from pathlib import Path

_WITHIN_S = 60.0
_POLL_S = 0.05


def main(command: list[str]) -> int:
    """Returns the command's exit code."""
    recorded = Path(command[command.index("--record") + 1]) if "--record" in command else None
    with subprocess.Popen(command, stdout=None if recorded else subprocess.PIPE) as running:
        if running.stdout:
            sys.stdout.buffer.write(running.stdout.readline())
        elif recorded:
            deadline_s = time.monotonic() + _WITHIN_S
            while running.poll() is None and not (recorded.exists() and recorded.stat().st_size):
                if time.monotonic() > deadline_s:
                    sys.exit(f"{recorded} was not written within {_WITHIN_S:g} s")
                time.sleep(_POLL_S)
        running.send_signal(signal.SIGINT)
        if running.stdout:
            sys.stdout.buffer.write(running.stdout.read())
    return running.returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
