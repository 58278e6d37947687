"""A calendar clock of a test's own for the programs that it starts, which can be stepped."""

import os
import struct
import subprocess
from pathlib import Path
from typing import Final

_SOURCE: Final = Path(__file__).with_suffix(".c")
_STEP: Final = struct.Struct("q")
_NS_PER_S: Final = 1_000_000_000


class CalendarClock:
    """Steps CLOCK_REALTIME of programs that run with its environment; the machine's clock stays as it is.

    Args:
        directory: for the library that is preloaded, and the file that it reads the step from.
    """

    def __init__(self, directory: Path) -> None:
        self._file = directory / "clock-step"
        library = directory / "calendar_clock.so"
        compiler = ["cc", "-O2", "-shared", "-fPIC", "-o", str(library), str(_SOURCE), "-ldl"]
        subprocess.run(compiler, check=True)
        self.environment = {"LD_PRELOAD": str(library), "CALENDAR_CLOCK": str(self._file)}
        self._file.write_bytes(_STEP.pack(0))

    def step(self, seconds: float) -> None:
        """Has the clock show the machine's time and so much more."""
        # In place: the programs have mapped the file.
        file = os.open(self._file, os.O_WRONLY)
        os.pwrite(file, _STEP.pack(int(seconds * _NS_PER_S)), 0)
        os.close(file)
