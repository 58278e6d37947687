"""Health check for the container: exits 0 if the bridge serves, else 1.

`python -m bridge.health` reads the same configuration as the program. A hub that can't be reached and a full
disk are no reasons to be unhealthy: a restart would mend nothing.
"""

from functools import partial

from bridge.config import BridgeSettings
from common.config import load
from common.healthcheck import check_program


def main() -> None:
    """Runs the check and exits."""
    check_program(partial(load, BridgeSettings), "ROBOT_BRIDGE_CONFIG")


if __name__ == "__main__":
    main()
