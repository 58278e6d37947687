"""Health check for the container: exits 0 if the receiver is connected to the hub, else 1.

`python -m hub.receiver.health` reads the same configuration as the program.
"""

import os
from pathlib import Path

from common.config import load
from common.errors import UserError
from common.healthcheck import state_of
from hub.receiver.config import ReceiverSettings


def main() -> None:
    """Runs the check and exits."""
    named = os.environ.get("ROBOT_RECEIVER_CONFIG")
    try:
        settings = load(ReceiverSettings, Path(named) if named else None)
    except UserError as error:
        raise SystemExit(str(error)) from error
    state = state_of(f"unix:{settings.socket}", "receiver")
    print(f"{settings.socket}: {state}")
    raise SystemExit(0 if state == "SERVING" else 1)


if __name__ == "__main__":
    main()
