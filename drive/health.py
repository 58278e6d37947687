"""Health check for the container: exits 0 if the drive program reports its state, else 1.

`python -m drive.health` reads the same configuration as the program. What is wrong around it (no base, a
latched stop) is no reason to be unhealthy: a restart would mend none of it.
"""

from functools import partial
from pathlib import Path

from common.config import load
from common.healthcheck import check_state
from drive.config import DriveSettings
from drive.endpoint.client import observed_state
from omniseer.drive.v1 import drive_pb2 as pb


def main() -> None:
    """Runs the check and exits."""
    check_state(partial(load, DriveSettings), "ROBOT_DRIVE_CONFIG", _phase)


def _phase(socket: Path) -> str:
    return pb.Phase.Name(observed_state(socket).phase).removeprefix("PHASE_").lower()


if __name__ == "__main__":
    main()
