"""Health check for the container: exits 0 if the bridge serves, else 1.

`python -m bridge.health` reads the same configuration as the program. A hub that can't be reached and a full
disk are no reasons to be unhealthy: a restart would mend nothing.
"""

import os
from pathlib import Path

from bridge.config import BridgeSettings
from common.config import load
from common.errors import UserError
from common.healthcheck import state_of


def main() -> None:
    """Runs the check and exits."""
    named = os.environ.get("ROBOT_BRIDGE_CONFIG")
    try:
        settings = load(BridgeSettings, Path(named) if named else None)
    except UserError as error:
        raise SystemExit(str(error)) from error
    state = state_of(f"unix:{settings.socket}")
    print(f"{settings.socket}: {state}")
    raise SystemExit(0 if state == "SERVING" else 1)


if __name__ == "__main__":
    main()
