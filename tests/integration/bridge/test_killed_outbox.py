"""The outbox of a bridge that is killed: what it has acknowledged is there, whole and in order."""

import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import Final

from bridge.events.values import Event, Position
from bridge.outbox.database import DAMAGED_NAME, Database
from tests.support.outbox_child import MAX_BYTES, RUN

KILLS: Final = 5
LEAST: Final = 150
"""Events of a round: some batches leave meanwhile, and the WAL is written back."""


def killed_after(directory: Path, first: int) -> int:
    """Has a process take events, kills it amid them, and returns the last one that it has acknowledged."""
    child = subprocess.Popen(
        [sys.executable, "-m", "tests.support.outbox_child", str(directory), str(first)],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert child.stdout
    with child, child.stdout as acknowledged:
        for sequence in range(first, first + LEAST):
            assert acknowledged.readline() == f"{sequence}\n"
        child.kill()
        rest = acknowledged.read().rpartition("\n")[0].splitlines()
    return int(rest[-1]) if rest else first + LEAST - 1


def test_what_was_acknowledged_survives_sigkill(tmp_path: Path) -> None:
    position = 0
    for _ in range(KILLS):
        acknowledged = killed_after(tmp_path, position + 1)
        with closing(Database(tmp_path, MAX_BYTES)) as database:
            database.open()
            found = database.facts.position
        assert found
        # One more may have been taken whose acknowledgement was not printed any more.
        assert acknowledged <= found.sequence <= acknowledged + 1
        position = found.sequence
    left: list[int] = []
    with closing(Database(tmp_path, MAX_BYTES)) as database:
        while batch := database.next_batch():
            left += [item.sequence for item in batch.items if isinstance(item, Event)]
            database.delivered(batch, repeated=False)
        assert database.facts.position == Position(RUN, position)
    assert left == list(range(left[0], position + 1)), "each once, and in order"
    assert not (tmp_path / DAMAGED_NAME).exists()
