"""Driving over the whole path: client library, gateway, robot-drive, double of twist_mux, a base behind it.

Takes root, for the links that lose packets.
"""

import tempfile
from collections.abc import Collection
from pathlib import Path

from bench.catalogue import rows_of
from bench.drive.ground import driven_ground
from bench.rows import Row


def run(names: Collection[str]) -> list[Row]:
    with tempfile.TemporaryDirectory() as directory, driven_ground(Path(directory)) as ground:
        return rows_of(names, ground)
