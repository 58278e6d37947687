"""Recording on the robot: robot-recorder beside a publisher of numbered messages, over real Fast DDS.

Takes up to 3 GB of the disk of the temporary directory.
"""

import tempfile
from collections.abc import Collection
from pathlib import Path

from bench.catalogue import rows_of
from bench.ros_domain import ros_domain
from bench.rows import Row


def run(names: Collection[str]) -> list[Row]:
    with tempfile.TemporaryDirectory() as directory, ros_domain():
        return rows_of(names, Path(directory))
