"""How long robotctl takes to start: its help, and a status, against an empty Python program.

All three are whole processes, one after the other in each round.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rows import Row
from bench.stack import running_stack

ROUNDS: Final = 9
BAR_MS: Final = 250
_ROBOTCTL: Final = str(Path(sys.executable).parent / "robotctl")
_TIMEOUT_S: Final = 20.0


def run(names: list[str]) -> list[Row]:
    with running_stack() as stack, tempfile.TemporaryDirectory() as home:
        commands = {
            "python -c pass": [sys.executable, "-c", "pass"],
            "cli.start_ms": [_ROBOTCTL, "--help"],
            "cli.status_ms": [_ROBOTCTL, "status", "--target", f"127.0.0.1:{stack.port}"],
        }
        took_ms: dict[str, list[float]] = {name: [] for name in commands}
        for number in range(-1, ROUNDS):  # one more before them: files are read from disk only then
            for name, command in commands.items():
                once_ms = _took_ms(command, home)
                if number >= 0:
                    took_ms[name].append(once_ms)
        log(f"cli: python -c pass takes {min(took_ms['python -c pass']):.0f} ms at least")
    empty_ms = sorted(took_ms["python -c pass"])[ROUNDS // 2]
    beside = f"(python -c pass: {empty_ms:.0f} ms)"
    rows = [
        Row(
            name="cli.start_ms",
            what=f"robotctl --help, the whole process {beside}",
            unit="ms",
            values=took_ms["cli.start_ms"],
            bar=BAR_MS,
        ),
        Row(
            name="cli.status_ms",
            what=f"robotctl status, the whole process {beside}",
            unit="ms",
            values=took_ms["cli.status_ms"],
            bar=BAR_MS,
        ),
    ]
    return [row for row in rows if not names or row.name in names]


def _took_ms(command: list[str], home: str) -> float:
    begun_s = time.perf_counter()
    subprocess.run(
        command,
        env={"XDG_CONFIG_HOME": home, "HOME": home},
        stdout=subprocess.DEVNULL,
        check=True,
        timeout=_TIMEOUT_S,
    )
    return (time.perf_counter() - begun_s) * 1000
