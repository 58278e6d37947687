"""Driving over the whole path: client library, gateway, robot-drive, double of twist_mux, a base behind it.

Takes about 25 min, and root for the links that lose packets.
"""

import importlib
import tempfile
from pathlib import Path

from bench.drive.ground import driven_ground
from bench.rows import Row

_MODULES = {
    "bench.drive.stopping": tuple(
        f"drive.stop_{fault}_ms"
        for fault in (
            "release",
            "client_killed",
            "cable_cut",
            "gateway_killed",
            "gateway_frozen",
            "viewer",
            "viewer_lossy",
        )
    ),
    "bench.drive.thawing": ("drive.thawed_ms",),
    "bench.drive.cpu": ("drive.cpu", "drive.cpu_idle"),
    "bench.drive.losses": (
        "drive.false_stops",
        "drive.false_stops_one_lane",
        "drive.false_stops_very_lossy",
        "drive.command_p99_ms",
    ),
}
"""Each has `rows(ground, wanted)`, which measures the wanted ones of its rows."""


def run(names: list[str]) -> list[Row]:
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as directory, driven_ground(Path(directory)) as ground:
        for module, offered in _MODULES.items():
            wanted = {name for name in offered if not names or name in names}
            if wanted:
                rows += importlib.import_module(module).rows(ground, wanted)
    return rows
