"""A bridge's outbox to be killed: `python -m tests.support.outbox_child DIRECTORY FIRST`.

Takes numbered events from FIRST on, and delivers a batch now and then. Each line of standard output is the
sequence of an event that it has acknowledged.
"""

import sys
from pathlib import Path
from typing import Final

from bridge.events.values import Event, Position
from bridge.outbox.database import Database

RUN: Final = "run-1"
MAX_BYTES: Final = 64 * 1024 * 1024
_MOST: Final = 100_000
_DELIVERED_EVERY: Final = 100


def main(directory: Path, first: int) -> None:
    """Takes events until the process is killed."""
    database = Database(directory, MAX_BYTES)
    database.open()
    for sequence in range(first, first + _MOST):
        event = Event(RUN, sequence, 1, b"%d" % sequence)
        database.append([event], database.facts.position, Position(RUN, sequence))
        print(sequence, flush=True)
        if sequence % _DELIVERED_EVERY == 0 and (batch := database.next_batch()):
            database.delivered(batch, repeated=False)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
