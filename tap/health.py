"""Health check for the container: exits 0 if the camera tap reports its state, else 1.

`python -m tap.health` reads the same configuration as the program. A topic that nothing publishes is no
reason to be unhealthy: a restart would not mend it.
"""

import os
from pathlib import Path

from common.config import load
from common.errors import UserError
from tap.client import observed_state
from tap.config import TapSettings


def main() -> None:
    """Runs the check and exits."""
    named = os.environ.get("ROBOT_TAP_CONFIG")
    try:
        settings = load(TapSettings, Path(named) if named else None)
        state = observed_state(settings.socket)
    except UserError as error:
        raise SystemExit(str(error)) from error
    print(f"{settings.socket}: {len(state.get('wanted', ()))} cameras wanted")


if __name__ == "__main__":
    main()
