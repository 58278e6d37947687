"""Runs a part of the benchmarks in a process of its own.

So one that fails, hangs or crashes costs its own rows only, and leaves nothing in the memory in which the
next ones are measured.
"""

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from bench.catalogue import Part
from bench.progress import log
from bench.results import read_rows
from bench.rows import Row
from common import ros_transport

_PATIENCE: Final = 3.0
"""How many times its minutes a part may take ..."""
_MORE_MINUTES: Final = 10.0
"""... and how many more, for what starts slowly."""
_END_WITHIN_S: Final = 30.0


def measured(part: Part, names: Sequence[str]) -> list[Row]:
    """Returns the wanted rows of a part; none when it fails or takes too long, which is logged."""
    limit_min = part.minutes * _PATIENCE + _MORE_MINUTES
    with tempfile.TemporaryDirectory() as directory:
        file = Path(directory) / "rows.json"
        command = [sys.executable, "-m", "bench.measure", str(file), *names]
        # The transport that containers and systemd units have.
        environment = {**os.environ, ros_transport.VARIABLE: "udp"}
        # A session of its own: whatever it has started is ended with it.
        process = subprocess.Popen(command, stdout=sys.stderr, env=environment, start_new_session=True)
        try:
            code = process.wait(limit_min * 60)
        except subprocess.TimeoutExpired:
            log(f"{part.module}: not done after {limit_min:.0f} min")
            return []
        finally:
            _end(process)
        if code:
            log(f"{part.module}: ended with {code}")
            return []
        return read_rows(file)


def _end(process: "subprocess.Popen[bytes]") -> None:
    """Ends a process that still runs, as Ctrl-C does, then by force, and what is left of its session."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            process.wait(_END_WITHIN_S)
    with suppress(ProcessLookupError):  # nothing is left
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
