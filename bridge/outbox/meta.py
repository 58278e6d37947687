"""Single values of the outbox's database: whose it is, where it stands, what it has counted."""

import sqlite3
from typing import Any, Final

COUNTS: Final = ("events", "sent", "dropped")
_LARGEST: Final = 2**53
"""Of a count: a robot has far fewer events."""


def get(db: sqlite3.Connection, key: str) -> Any:
    """Returns a value; None if it was never set."""
    row = db.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
    return row[0] if row else None


def put(db: sqlite3.Connection, key: str, value: str | int) -> None:
    """Sets a value."""
    db.execute("INSERT OR REPLACE INTO meta VALUES (?, ?)", (key, value))


def count(db: sqlite3.Connection, key: str, more: int) -> None:
    """Adds to a number."""
    if more:
        put(db, key, (get(db, key) or 0) + more)


def restore_counts(db: sqlite3.Connection) -> None:
    """Begins a count anew that a bad disk has changed to what is none."""
    db.executemany(
        "UPDATE meta SET value = 0"
        " WHERE key = ? AND NOT (typeof(value) = 'integer' AND value BETWEEN 0 AND ?)",
        [(key, _LARGEST) for key in COUNTS],
    )


def position_makes_sense(db: sqlite3.Connection) -> bool:
    """Returns whether there is a whole position, or none."""
    match get(db, "run_id"), get(db, "sequence"):
        case (None, None):
            return True
        case (str(), int(sequence)):
            return sequence >= 0
        case _:
            return False
