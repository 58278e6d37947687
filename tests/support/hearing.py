"""Listens to odometry as the gateway does; prints after how many seconds it was heard, or "silent".

`python -m tests.support.hearing SECONDS`: Fast DDS learns the network interfaces of a process once, so that a
test that adds one needs a new process.
"""

import sys
import time

from gateway.config import DEFAULT_SOURCES
from gateway.ros.intake import intake
from gateway.status.board import Board
from gateway.status.sources import ODOMETRY
from tests.support.waiting import wait_until


def main() -> None:
    board, began_s = Board(), time.monotonic()
    with intake(DEFAULT_SOURCES, board):
        try:
            wait_until(lambda: board[ODOMETRY] is not None, "it is heard", float(sys.argv[1]))
        except AssertionError:
            print("silent")
        else:
            print(time.monotonic() - began_s)


if __name__ == "__main__":
    main()
