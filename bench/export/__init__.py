"""Copying a recording off the robot: recorder, gateway and client are the real programs, over TCP."""

import tempfile
from collections.abc import Collection
from pathlib import Path

from bench.catalogue import rows_of
from bench.export.ground import exporting_robot
from bench.rows import Row


def run(names: Collection[str]) -> list[Row]:
    with tempfile.TemporaryDirectory() as directory, exporting_robot(Path(directory)) as robot:
        return rows_of(names, robot)
