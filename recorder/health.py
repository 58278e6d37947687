"""Health check for the container: exits 0 if the recorder serves, else 1.

`python -m recorder.health` reads the same configuration as the program. A full disk is no reason to be
unhealthy: a restart would mend nothing.
"""

from functools import partial

from common.config import load
from common.healthcheck import check_program
from recorder.config import RecorderSettings


def main() -> None:
    """Runs the check and exits."""
    check_program(partial(load, RecorderSettings), "ROBOT_RECORDER_CONFIG")


if __name__ == "__main__":
    main()
