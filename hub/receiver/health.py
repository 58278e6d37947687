"""Health check for the container: exits 0 if the receiver is connected to the hub, else 1.

`python -m hub.receiver.health` reads the same configuration as the program.
"""

from functools import partial

from common.config import load
from common.healthcheck import check_program
from hub.receiver.config import ReceiverSettings


def main() -> None:
    """Runs the check and exits."""
    check_program(partial(load, ReceiverSettings), "ROBOT_RECEIVER_CONFIG", "receiver")


if __name__ == "__main__":
    main()
