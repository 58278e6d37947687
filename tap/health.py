"""Health check for the container: exits 0 if the camera tap reports its state, else 1.

`python -m tap.health` reads the same configuration as the program. A topic that nothing publishes is no
reason to be unhealthy: a restart would not mend it.
"""

from functools import partial
from pathlib import Path

from common.config import load
from common.healthcheck import check_state
from tap.client import observed_state
from tap.config import TapSettings


def main() -> None:
    """Runs the check and exits."""
    check_state(partial(load, TapSettings), "ROBOT_TAP_CONFIG", _cameras)


def _cameras(socket: Path) -> str:
    return f"{len(observed_state(socket).get('wanted', ()))} cameras wanted"


if __name__ == "__main__":
    main()
