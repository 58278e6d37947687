"""The order of the outbox's items, which shows what no checksum does: that a bad disk has changed one.

Each item begins where the one before it ends, in the same run, or is a gap that begins a run (`earlier`); the
last one ends at the position that the outbox has.
"""

import sqlite3
from typing import Final

Place = tuple[str | None, int | None]
"""Run and sequence."""
_MOST_MISPLACED: Final = 8
"""Rows that are put right; more are not the work of a single bad place of a disk."""
_MISPLACED: Final = """
    SELECT id, before_run, due, end FROM (
      SELECT id, run_id, first, last, payload IS NULL AS gap, earlier,
        lag(run_id) OVER w AS before_run, lag(last) OVER w + 1 AS due,
        lead(run_id) OVER w AS after_run, lead(first) OVER w - 1 AS end, lead(earlier) OVER w AS after_earlier
      FROM items WINDOW w AS (ORDER BY id)
    )
    WHERE before_run = after_run AND after_earlier IS 0 AND (end = due OR gap AND end >= due - 1)
      AND (run_id, first, last, earlier) IS NOT (before_run, due, end, 0)
    LIMIT 1
"""
_DISORDER: Final = """
    SELECT EXISTS (
      SELECT 1 FROM (
        SELECT run_id, first, earlier, lag(run_id) OVER w AS before_run, lag(last) OVER w + 1 AS due
        FROM items WINDOW w AS (ORDER BY id)
      )
      WHERE before_run IS NOT NULL AND NOT (earlier AND run_id IS NOT before_run)
        AND (run_id, first, earlier) IS NOT (before_run, due, 0)
    )
"""


def restored(db: sqlite3.Connection, position: Place, sent: Place | None) -> bool:
    """Returns whether all items are in order, after rows that are not have been put right where they can be.

    A row can be whose neighbours fit each other: it gets the place between them.

    Args:
        db: the outbox's database.
        position: after the last item, as the database has it.
        sent: where the batch ended that was sent last; it is the position where there are no items.
    """
    for _ in range(_MOST_MISPLACED):
        if not (disorder := db.execute(_DISORDER).fetchone()[0]):
            break
        if (row := db.execute(_MISPLACED).fetchone()) is None:
            break
        row_id, *place = row
        db.execute(
            "UPDATE items SET run_id = ?, first = ?, last = ?, earlier = 0 WHERE id = ?", (*place, row_id)
        )
    last = db.execute("SELECT run_id, last FROM items ORDER BY id DESC LIMIT 1").fetchone()
    return not disorder and (last or sent) in (None, position)
