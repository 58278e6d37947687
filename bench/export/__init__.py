"""Copying a recording off the robot: recorder, gateway and client are the real programs, over TCP.

Takes about 3 min.
"""

import importlib
import tempfile
from pathlib import Path

from bench.export.ground import exporting_robot
from bench.rows import Row

_MODULES = {
    "bench.export.throughput": ("export.throughput",),
    "bench.export.resuming": ("export.resume_kib",),
    "bench.export.status": ("export.status_p99", "export.status_p99_unlimited"),
}
"""Each has `rows(robot, wanted)`, which measures the wanted ones of its rows."""


def run(names: list[str]) -> list[Row]:
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as directory, exporting_robot(Path(directory)) as robot:
        for module, offered in _MODULES.items():
            wanted = {name for name in offered if not names or name in names}
            if wanted:
                rows += importlib.import_module(module).rows(robot, wanted)
    return rows
