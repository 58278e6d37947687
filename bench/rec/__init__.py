"""Recording on the robot: robot-recorder beside a publisher of numbered messages, over real Fast DDS.

Takes about 25 min, and up to 3 GB of the disk of the temporary directory.
"""

import importlib
import tempfile
from pathlib import Path

from bench.rec.ground import ros_domain
from bench.rows import Row

_MODULES = {
    "bench.rec.losing": ("rec.lost_10", "rec.lost_40"),
    "bench.rec.cpu": ("rec.cpu", "rec.idle_cpu", "rec.ring_cpu"),
    "bench.rec.video": ("rec.preview_tap", "rec.stamps"),
    "bench.rec.killing": ("rec.kill_loss_ms",),
    "bench.rec.recovering": ("rec.recovery_mib_s",),
    "bench.rec.snapshots": ("rec.snapshot_ms", "rec.snapshot_disk"),
}
"""Each has `rows(workdir, wanted)`, which measures the wanted ones of its rows in an empty directory."""


def run(names: list[str]) -> list[Row]:
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as directory, ros_domain():
        for module, offered in _MODULES.items():
            wanted = {name for name in offered if not names or name in names}
            if wanted:
                workdir = Path(directory) / module.rpartition(".")[2]
                workdir.mkdir()
                rows += importlib.import_module(module).rows(workdir, wanted)
    return rows
