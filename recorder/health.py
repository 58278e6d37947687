"""Health check for the container: exits 0 if the recorder serves, else 1.

`python -m recorder.health` reads the same configuration as the program. A full disk is no reason to be
unhealthy: a restart would mend nothing.
"""

import os
from pathlib import Path

from common.config import load
from common.errors import UserError
from common.healthcheck import state_of
from recorder.config import RecorderSettings


def main() -> None:
    """Runs the check and exits."""
    named = os.environ.get("ROBOT_RECORDER_CONFIG")
    try:
        settings = load(RecorderSettings, Path(named) if named else None)
    except UserError as error:
        raise SystemExit(str(error)) from error
    state = state_of(f"unix:{settings.socket}")
    print(f"{settings.socket}: {state}")
    raise SystemExit(0 if state == "SERVING" else 1)


if __name__ == "__main__":
    main()
