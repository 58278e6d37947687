"""The fleet's hub: three real nodes on this machine, every message synced before it is acknowledged."""

import importlib
import tempfile
from pathlib import Path

from bench.rows import Row

_MODULES = {
    "bench.fleet.failures": ("fleet.lost", "fleet.duplicates", "fleet.disordered", "fleet.gap_s"),
    "bench.fleet.rates": ("fleet.events_s", "fleet.batched_events_s"),
    "bench.fleet.cost": ("fleet.robot_kib", "fleet.robot_cpu"),
    "bench.fleet.uploading": ("fleet.upload_resume_mib",),
}
"""Each has `rows(workdir, wanted)`, which measures the wanted ones of its rows."""


def run(names: list[str]) -> list[Row]:
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as workdir:
        for module, offered in _MODULES.items():
            wanted = {name for name in offered if not names or name in names}
            if wanted:
                rows += importlib.import_module(module).rows(Path(workdir), wanted)
    return rows
