"""Health check for the container: exits 0 if the drive program reports its state, else 1.

`python -m drive.health` reads the same configuration as the program. What is wrong around it (no base, a
latched stop) is no reason to be unhealthy: a restart would mend none of it.
"""

import os
from pathlib import Path

from common.config import load
from common.errors import UserError
from drive.client import observed_state
from drive.config import DriveSettings
from omniseer.drive.v1 import drive_pb2 as pb


def main() -> None:
    """Runs the check and exits."""
    named = os.environ.get("ROBOT_DRIVE_CONFIG")
    try:
        settings = load(DriveSettings, Path(named) if named else None)
        state = observed_state(settings.socket)
    except UserError as error:
        raise SystemExit(str(error)) from error
    print(f"{settings.socket}: {pb.Phase.Name(state.phase).removeprefix('PHASE_').lower()}")


if __name__ == "__main__":
    main()
